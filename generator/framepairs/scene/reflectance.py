"""Reflectance of dielectrics at normal incidence (F0) in terms of Material.specular, the same for every file format."""

from ..errors import InputError

LARGEST_F0 = 0.08  # of specular 1; an ior of 1.789 has it


def f0_of_ior(ior: float, name: str) -> float:
    """((ior - 1) / (ior + 1))^2, Fresnel's equations at normal incidence against air. Raises InputError naming `name`, the
    material, below 0."""
    if not ior >= 0:
        raise InputError(f"index of refraction {ior}, 0 or more is expected", field=name)
    return ((ior - 1) / (ior + 1)) ** 2


def specular_of_f0(f0: float, what: str) -> tuple[float, tuple[str, ...]]:
    """(specular in [0, 1], what is left out): F0 = 0.08 specular is limited to 0.08, which is told in the words of `what`."""
    said = (f"{what}: F0 is {LARGEST_F0}, not {f0:.3g}",) if f0 > LARGEST_F0 * (1 + 1e-6) else ()
    return min(round(f0 / LARGEST_F0, 12), 1.0), said  # rounded, so that an ior of 1.5 is 0.5 and not its neighbour
