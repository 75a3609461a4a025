"""The development scenes: what stands where, under which light. Read by `make_development_scenes.py`."""
from dataclasses import dataclass


@dataclass(frozen=True)
class Recipe:
    """A scene.

    `objects` are names of `scene_objects.py`, each with its place (x, z) on the ground and its radius; `light` and
    `other_light` are panoramas without their ending; `background` is what scene.json says; with `light_is_full` photos
    are taken under the panorama as it is, else under its 64 x 32 means; `lobe` is `modct` or `ggx`; `elevation` is the
    range of the cameras in degrees above the horizon; `ground` is a finish of `scene_materials.py`, or none.
    """

    name: str
    objects: tuple
    ground: str | None
    light: str
    other_light: str
    background: str
    light_is_full: bool
    lobe: str
    elevation: tuple = (8.0, 62.0)


def one(name):
    return ((name, 0.0, 0.0, 1.0),)


TABLE = (("bottle", -1.0, 0.5, 0.9), ("avocado", 0.75, 0.9, 0.55), ("teapot", 0.55, -0.75, 0.85))
BLACK, SHOWN = "black", "environment"

RECIPES = (
    Recipe("bottle-noon", one("bottle"), None, "noon_grass", "lebombo", BLACK, False, "modct", (-25.0, 60.0)),
    Recipe("bottle-lounge", one("bottle"), "planks", "lebombo", "kiara_1_dawn", SHOWN, True, "ggx"),
    Recipe("avocado-square", one("avocado"), "stone", "potsdamer_platz", "venice_sunset", SHOWN, False, "modct"),
    Recipe("helmet-studio", one("helmet"), None, "studio_small_03", "noon_grass", BLACK, True, "modct", (-20.0, 55.0)),
    Recipe("delft-noon", one("delft"), "asphalt", "kloppenheim_05", "kiara_1_dawn", SHOWN, True, "modct", (22.0, 62.0)),
    Recipe("suburb-slope", one("suburb"), "asphalt", "forest_slope", "kloppenheim_05", BLACK, False, "ggx", (22.0, 62.0)),
    Recipe("bunny-park", one("bunny"), "checker", "rooitou_park", "studio_small_03", SHOWN, False, "modct"),
    Recipe("spot-slope", one("spot"), None, "forest_slope", "chinese_garden", BLACK, True, "ggx", (-20.0, 60.0)),
    Recipe("cow-sunset", one("cow"), "checker", "venice_sunset", "aerodynamics_workshop", SHOWN, True, "modct"),
    Recipe("teapot-workshop", one("teapot"), "planks", "aerodynamics_workshop", "rooitou_park", SHOWN, False, "ggx"),
    Recipe("teddy-garden", one("teddy"), None, "chinese_garden", "potsdamer_platz", BLACK, True, "modct", (-15.0, 60.0)),
    Recipe("table-terrain", TABLE, "stone", "hilly_terrain_01", "lebombo", SHOWN, True, "ggx"),
)


@dataclass(frozen=True)
class Scale:
    """Sizes of all scenes: photos, views (every sixth held out), texels a side of the maps, paths a pixel."""

    width: int
    height: int
    views: int
    map_size: int
    samples: int


SCALES = {"full": Scale(192, 144, 36, 256, 512), "quarter": Scale(96, 72, 24, 128, 1024)}
HOLD_OUT_EVERY = 6
