"""The same scenes through MuJoCo's OpenGL renderer, by its best recipe, where there is one on this machine.

Per camera one pass for colour and depth and one for ids; no shadows, reflections, sky, haze, textures or
multisampling. `render` leaves everything as OpenGL's buffers hold it. `convert` is what a user adds to have what
our sensor gives: metric depth, ids of visuals and world positions, by the fastest of several ways to write it in
NumPy (single precision, arrays made once, one axis of the positions at a time). The rows stay in OpenGL's order,
bottom first, as a view turns them at no cost.
"""

import os

import mujoco
import numpy as np
from sensor_scenes import BenchmarkScene

from artiskill.sensors.camera import Camera
from artiskill.sensors.drawing.backdrop import FLOOR, NOTHING
from artiskill.sensors.renderer import Images


class GlSensor:
    """A MuJoCo model with one mesh per visual, and what draws it."""

    def __init__(self, scene: BenchmarkScene) -> None:
        """Build the model and an off-screen context; raises whatever a missing driver raises."""
        self.cameras = scene.cameras
        height, width = scene.cameras[0].height, scene.cameras[0].width
        self.model = _model(scene, width, height)
        self.data = mujoco.MjData(self.model)
        self.data.mocap_pos[:] = scene.positions
        self.data.mocap_quat[:] = scene.quaternions
        mujoco.mj_kinematics(self.model, self.data)
        self._gl = mujoco.GLContext(width, height)
        self._gl.make_current()
        self.context = mujoco.MjrContext(self.model, mujoco.mjtFontScale.mjFONTSCALE_50)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self.context)
        self.scene = mujoco.MjvScene(self.model, maxgeom=self.model.ngeom + 10)
        self.viewport = mujoco.MjrRect(0, 0, width, height)
        self.rgb = np.empty((len(self.cameras), height, width, 3), dtype=np.uint8)
        self.ids = np.empty_like(self.rgb)
        self.depth = np.empty((len(self.cameras), height, width), dtype=np.float32)
        self._option, self._free = mujoco.MjvOption(), mujoco.MjvCamera()
        self.depth_m, self.geom = np.empty_like(self.depth), np.empty(self.depth.shape, dtype=np.int32)
        self.position_w = np.empty((*self.depth.shape, 3), dtype=np.float32)
        self._plane = np.empty((height, width), dtype=np.float32)
        # the numbers in `ids`: 0 nothing, then the visuals in their order, then the ground
        ours = [NOTHING, *range(len(scene.visuals)), FLOOR]
        self._geom_of = np.array(ours + [NOTHING] * (256 - len(ours)), dtype=np.int32)
        self.context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR  # needs no conversion

    def render(self) -> None:
        """Draw all cameras into `rgb`, `depth` and `ids`."""
        kinds = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self.model, self.data, self._option, None, self._free, kinds, self.scene)
        flags = self.scene.flags
        flags[:] = 0
        flags[mujoco.mjtRndFlag.mjRND_CULL_FACE] = 1
        for i, camera in enumerate(self.cameras):
            for eye in self.scene.camera:
                _aim(eye, camera)
            for segment in (0, 1):
                flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = segment
                mujoco.mjr_render(self.viewport, self.scene, self.context)
                image, depth = (self.ids[i], None) if segment else (self.rgb[i], self.depth[i])
                mujoco.mjr_readPixels(image, depth, self.viewport, self.context)

    def convert(self) -> None:
        """Fill `depth_m`, `geom` and `position_w` from the last rendering: metres and our ids."""
        height, width = self.depth.shape[1:]
        columns = np.arange(width, dtype=np.float32)
        rows = np.arange(height - 1, -1, -1, dtype=np.float32)
        for i, camera in enumerate(self.cameras):
            near, far, z = camera.near_m, camera.far_m, self.depth_m[i]
            # the buffer is linear in 1 / z, 0 at the far plane and 1 at the near one
            np.multiply(self.depth[i], np.float32(1 / near - 1 / far), out=z)
            np.add(z, np.float32(1 / far), out=z)
            np.divide(np.float32(1), z, out=z)
            np.take(self._geom_of, self.ids[i, ..., 0], out=self.geom[i], mode="clip")
            focal, centre_x, centre_y = camera.lens[:3]
            r = camera.rotation_w
            along, across = (columns + 0.5 - centre_x) / focal, (centre_y - 0.5 - rows) / focal
            for k in range(3):
                of_row = (r[k, 1] * across - r[k, 2]).astype(np.float32)
                of_column = (r[k, 0] * along).astype(np.float32)
                np.add(of_row[:, None], of_column, out=self._plane)
                np.multiply(self._plane, z, out=self._plane)
                np.add(self._plane, np.float32(camera.position_w[k]), out=self.position_w[i, ..., k])
            nothing = self.geom[i] == NOTHING
            if nothing.any():
                z[nothing], self.position_w[i, nothing] = 0.0, 0.0

    def differences(self, ours: Images) -> str:
        """How far the converted images are from ours, so that both draw the same: a line to print."""
        geom, depth, place = self.geom[:, ::-1], self.depth_m[:, ::-1], self.position_w[:, ::-1]
        same = geom == ours.geom
        off_m = np.abs(depth - ours.depth)[same]
        off_w_m = np.abs(place - ours.position_w).max(axis=-1)[same]
        return (
            f"ids equal in {100 * same.mean():.2f} % of pixels; there 99 % of depths within "
            f"{1e3 * np.quantile(off_m, 0.99):.3f} mm, of positions within "
            f"{1e3 * np.quantile(off_w_m, 0.99):.3f} mm"
        )

    def close(self) -> None:
        """Give the context back."""
        self.context.free()
        self._gl.free()


def driver() -> str:
    """Which OpenGL draws, once a context is current."""
    from OpenGL import GL

    return f"{GL.glGetString(GL.GL_RENDERER).decode()} ({os.environ.get('MUJOCO_GL', 'default backend')})"


def _model(scene: BenchmarkScene, width: int, height: int) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    visual = spec.visual
    visual.global_.offwidth, visual.global_.offheight = width, height
    visual.quality.offsamples = 0
    visual.quality.shadowsize = 0
    bodies = [spec.worldbody.add_body(name=f"body{i}", mocap=True) for i in range(len(scene.positions))]
    for i, item in enumerate(scene.visuals):
        mesh = spec.add_mesh(name=f"mesh{i}", inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        mesh.uservert = item.visual.mesh.vertices.astype(np.float32).reshape(-1)
        mesh.userface = item.visual.mesh.faces.astype(np.int32).reshape(-1)
        body = spec.worldbody if item.body < 0 else bodies[item.body]
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=f"mesh{i}",
            rgba=item.visual.material.rgba,
            contype=0,
            conaffinity=0,
        )
    last = spec.worldbody.add_body(name="ground")
    last.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(20, 20, 1), rgba=(0.4, 0.4, 0.4, 1))
    return spec.compile()


def _aim(eye: "mujoco.MjvGLCamera", camera: Camera) -> None:
    """Make MuJoCo's camera see what ours does."""
    eye.pos, eye.forward, eye.up = camera.position_w, -camera.rotation_w[:, 2], camera.rotation_w[:, 1]
    half = camera.near_m * np.tan(camera.fov_rad / 2)
    eye.frustum_center, eye.frustum_bottom, eye.frustum_top = 0.0, -half, half
    eye.frustum_width = half * camera.width / camera.height
    eye.frustum_near, eye.frustum_far = camera.near_m, camera.far_m
