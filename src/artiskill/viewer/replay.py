"""A replay: an episode as one HTML file that plays it without a server."""

import html
from collections.abc import Callable
from pathlib import Path

from artiskill.errors import ConfigError
from artiskill.files import atomic_write, check_output_folder, output_path
from artiskill.sensors.render_config import load_render_config
from artiskill.viewer import serving
from artiskill.viewer.episode_page import look_at_episode
from artiskill.viewer.playback import Moment, Player, Timeline
from artiskill.viewer.scene_view import TARGET, SceneView, add_stage, scene_bodies

# for which a replay stays at its end; then its caption is hidden, also for the first steps: a browser that begins
# anew takes a while to lay the first text out, and shows the last one until then
_LAST_S, _NO_CAPTION_S, _NO_CAPTION_STEPS = 1.0, 0.5, 10
_CLIENT_TITLE = "<title>Viser</title>"
# a replay on a page that is higher than wide: a picture as wide as it, in which the scene is whole
_HIGH_PAGES = "<style>@media (max-aspect-ratio: 1/1) { body, #root { height: 75vw !important; } }</style>"


def export_episode(
    timeline: Timeline, path: Path | str, on_step: Callable[[int], None] = lambda step: None
) -> Path:
    """Write an episode, to its end, as one HTML file that plays it without a server.

    Args:
        timeline: of the episode.
        path: ends in `.html`.
        on_step: called with the number of steps so far.

    Raises:
        ConfigError: an illegal path.
        MissingExtraError: viser is not installed.
    """
    path = output_path(path)
    if path.suffix.lower() not in (".html", ".htm"):
        raise ConfigError(f"a replay's name must end in .html, not {path.name!r}")
    check_output_folder(path.parent)
    with serving(port=0) as server:
        player, scene = Player(timeline), timeline.scene
        bodies, first = scene_bodies(scene), scene.index.object_bodies.start
        view = SceneView(server, bodies, scene.object, first, timeline.target)
        view.show_layer(TARGET, True)
        add_stage(server, load_render_config())
        look_at_episode(server, timeline, has_panel=False)
        caption = view.add_caption()
        caption.visible = False
        recording = server.get_scene_serializer()
        while True:
            moment = player.moment
            snapshot = moment.context.snapshot
            view.set_poses(snapshot.body_position_w[0], snapshot.body_quaternion_w[0])
            caption.text = _caption(moment)
            if player.position == _NO_CAPTION_STEPS:
                caption.visible = True
            recording.insert_sleep(snapshot.step_s)
            on_step(player.position)
            player.step()
            if player.position == moment.context.elapsed:
                break
        caption.text, caption.visible = _caption(player.moment), True  # which may end by a fault
        recording.insert_sleep(_LAST_S)
        caption.visible = False
        recording.insert_sleep(_NO_CAPTION_S)
        page = recording.as_html()
    page = page.replace(_CLIENT_TITLE, f"<title>{html.escape(timeline.title)}</title>{_HIGH_PAGES}", 1)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(path) as temporary:
            temporary.write_text(page, encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"cannot write the replay {str(path)!r}: {error.strerror or error}") from error
    return path


def _caption(moment: Moment) -> str:
    return " · ".join(part for part in (moment.progress, moment.end) if part)
