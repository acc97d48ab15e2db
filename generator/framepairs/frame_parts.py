"""What decides a frame's pixels, part by part: where the files of a scene change, only frames whose parts differ are rendered
again, and the differing part says why.

A part is a sha256 over values, not over files: an animation that changes at its end leaves the frames before it as they are.
"""

from typing import Any

from .backend import versions
from .conventions import Stream
from .digests import digest
from .frame import FrameState
from .jitter import jitter
from .job import Job
from .overlay_elements import is_shown
from .path_tracing import path_seed
from .plan import RenderPlan, jitter_length

# Keys of the plan that decide no pixels, or that streams and scenes tell for themselves.
TOLD_ELSEWHERE = frozenset(
    {
        "version", "display", "scales", "variants", "hr_native", "hr_mip0", "antialiasing", "antialiasing_pattern", "channels",
        "jitter_length", "seed", "subdivision", "mip_bias_offset", "motion_offsets", "demodulation", "brdf_floor",
        "softplus_beta",
    }
)  # fmt: skip
OF_PATH_SHADING = frozenset({"samples_per_pixel", "clamp_radiance", "max_depth"})
OF_RASTER_SHADING = frozenset({"light_samples", "mesh_lights", "ambient_occlusion", "ambient_occlusion_radius_m"})
DECIDING_PACKAGES = ("framepairs", "mitsuba", "drjit", "OpenEXR")


def frame_parts(job: Job, state: FrameState) -> dict[str, str]:
    """sha256 by part, of everything that all streams of the frame share."""
    named = [item.name for item in job.scene.objects]  # to which elements of an overlay may cling
    shown = [is_shown(element, state.time_s) for element in (job.overlay.elements if job.overlay else ())]
    overlay = None if job.overlay is None else (job.overlay_content, state.exposure_ev, shown, named)
    parts = {
        "versions": {name: version for name, version in versions().items() if name in DECIDING_PACKAGES},
        "backend": job.variant,
        "plan": _deciding_plan(job.plan),
        "camera": (state.camera, state.previous_camera, state.reset, state.render_origin),
        "objects": (state.objects, state.previous_objects),
        "lights": state.lights,
        "materials": state.materials,
        "overlay": overlay,
        "other times": state.others,
    }
    return {"scene": job.scene_content} | {name: digest(value) for name, value in parts.items()}


def stream_part(job: Job, frame: int, stream: Stream) -> str:
    """sha256 of what one stream of a frame has for itself: its size, samples, bias and jitter; with `path`, its seed."""
    offset = jitter(frame, jitter_length(job.plan, stream.scale)) if stream.jittered else (0.0, 0.0)
    seed = path_seed(job.seed, frame, stream) if job.plan.shading == "path" else None
    return digest((stream, offset, seed))


def _deciding_plan(plan: RenderPlan) -> dict[str, Any]:
    other = OF_RASTER_SHADING if plan.shading == "path" else OF_PATH_SHADING
    return plan.model_dump(mode="json", exclude=set(TOLD_ELSEWHERE | other))
