"""Whether light has changed on what stands still: then its history shows the old light, and is not believed.

Single samples differ from what is remembered wherever a pixel holds detail, up and down alike; a light that changes moves most
pixels of a neighbourhood the same way. FSR 2 compares blurred luma; a count of signs is not misled by thin bright things.
"""

from ..backend import dr, jit
from ..colour import luminance
from ..warp import Image, bilinear, fetch, pixel_centres
from .settings import UpscaleSettings
from .spatial import Jitter, opaque
from .surfaces import pixel_indices

REACH = 3  # LR pixels to each side of the neighbourhood
DARKEST = 1e-4  # after exposure; less counts as equally dark


def light_changed(samples: Image, history: Image, jitter: Jitter, exposure: float, settings: UpscaleSettings) -> Image:
    """[1] share in [0, 1] by which the light of each LR pixel is not that of the history at the same place.

    samples: LR [3], scene-linear. history: HR, its first three planes the same, as the previous frame left it.
    """
    x, y = pixel_centres(samples.width, samples.height)
    across, down = opaque(history.width / samples.width), opaque(history.height / samples.height)
    before = bilinear(
        Image(history.planes[:3], history.width, history.height),
        (x - opaque(jitter[0])) * across,
        (y - opaque(jitter[1])) * down,
    )
    darkest = opaque(DARKEST / exposure)
    now, then = (dr.maximum(luminance(jit.Array3f(*planes)), darkest) for planes in (samples.planes, before))
    step = opaque(settings.light_step) * dr.maximum(now, then)
    sign = dr.select(now - then > step, jit.Float(1), dr.select(then - now > step, jit.Float(-1), 0))
    dr.eval(sign)
    rows = _mean_along(Image((sign,), samples.width, samples.height), 1, 0)
    least = opaque(settings.light_share)
    share = dr.clip((dr.abs(_mean_along(rows, 0, 1).planes[0]) - least) / (0.5 * (1 - least)), 0, 1)
    dr.eval(share)
    return Image((share,), samples.width, samples.height)


def _mean_along(image: Image, across: int, down: int) -> Image:
    i, j = pixel_indices(image.width, image.height)
    total = jit.Float(0)
    for k in range(-REACH, REACH + 1):
        total += fetch(image, i + k * across, j + k * down)[0]
    total /= 2 * REACH + 1
    dr.eval(total)
    return Image((total,), image.width, image.height)
