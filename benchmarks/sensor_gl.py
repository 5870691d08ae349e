"""The same scenes through MuJoCo's OpenGL renderer, by its best recipe, where there is one on this machine.

Per camera one pass for colour and depth and one for ids; no shadows, reflections, sky, haze, textures or
multisampling. World positions are left out, depth is left as the buffer holds it: both in its favour.
"""

import os

import mujoco
import numpy as np
from sensor_scenes import BenchmarkScene

from artiskill.sensors.camera import Camera


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

    def seen(self) -> float:
        """Share of pixels that show a mesh: to compare with ours, so that both draw the same."""
        ids = self.ids[..., 0].astype(int) + 256 * self.ids[..., 1].astype(int)
        floor = self.model.ngeom - 1
        return float(((ids > 0) & (ids - 1 != floor)).mean())

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
