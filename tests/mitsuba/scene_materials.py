"""Finishes of the development scenes: base colour, metalness and roughness as glTF means them, and their maps here.

The conversion is glTF 2.0's (appendix B): diffuse = base (1 - metal), F0 = .04 (1 - metal) + base metal, and a width
a = roughness^2, of which roughness.exr holds r = a^2.
"""
import numpy as np

LEAST_ROUGHNESS = 0.2


def maps_of(base, metal, roughness):
    """(diffuse, F0, r) of finishes; `metal` and `roughness` are [n]."""
    metal = metal[:, None]
    r = np.clip(roughness, LEAST_ROUGHNESS, 1.0) ** 4
    return base * (1.0 - metal), 0.04 * (1.0 - metal) + base * metal, r


def linear(encoded):
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


class Picture:
    """An 8-bit picture, read bilinearly and repeated at its borders."""

    def __init__(self, mi, path, is_colour):
        pixels = np.array(mi.Bitmap(str(path)))[..., :3].astype(np.float64) / 255.0
        self.pixels = linear(pixels) if is_colour else pixels

    def at(self, uvs):
        height, width = self.pixels.shape[:2]
        x, y = uvs[:, 0] * width - 0.5, (1.0 - uvs[:, 1]) * height - 0.5
        left, top = np.floor(x).astype(int), np.floor(y).astype(int)
        fx, fy = (x - left)[:, None], (y - top)[:, None]
        tap = lambda row, column: self.pixels[row % height, column % width]
        return ((tap(top, left) * (1 - fx) + tap(top, left + 1) * fx) * (1 - fy)
                + (tap(top + 1, left) * (1 - fx) + tap(top + 1, left + 1) * fx) * fy)


def noise(seed, frequency):
    """A smooth function of space with values about .5: plane waves of random directions, periods over three octaves."""
    random = np.random.default_rng(seed)
    waves = random.normal(size=(32, 3)) * frequency * 2.0 ** random.uniform(0, 3, (32, 1))
    phases, weights = random.uniform(0, 2 * np.pi, 32), 1.0 / np.linalg.norm(waves, axis=1) ** 0.7
    weights /= np.linalg.norm(weights)
    return lambda p: np.clip(0.5 + 0.25 * (np.sin(p @ waves.T + phases) @ weights), 0.0, 1.0)


def blend(a, b, share):
    return np.asarray(a) + (np.asarray(b) - np.asarray(a)) * share[:, None]


def checker(p, n):
    odd = (np.floor(2.0 * p[:, 0]) + np.floor(2.0 * p[:, 2])) % 2
    return (blend([0.62, 0.58, 0.5], [0.12, 0.16, 0.2], odd) * (0.8 + 0.4 * noise(1, 4.0)(p)[:, None]),
            0 * odd, 0.35 + 0.3 * odd)


def planks(p, n):
    board = np.floor(3.0 * p[:, 2])
    grain = 0.5 + 0.5 * np.sin(60.0 * p[:, 2] + 4.0 * noise(2, 2.0)(p * [0.3, 1.0, 3.0]))
    tone = (board * 0.37) % 1.0
    return blend([0.42, 0.24, 0.12], [0.2, 0.1, 0.05], 0.5 * grain + 0.5 * tone), 0 * tone, 0.4 + 0.15 * tone


def stone(p, n):
    veins = np.abs(noise(3, 2.0)(p) - 0.5) * 2.0
    return blend([0.3, 0.28, 0.26], [0.68, 0.66, 0.62], np.sqrt(veins)), 0 * veins, 0.5 + 0.3 * noise(4, 1.5)(p)


def asphalt(p, n):
    line = (np.abs(p[:, 0] % 0.5 - 0.25) < 0.012) & (p[:, 2] % 0.2 < 0.12)
    grey = 0.1 + 0.12 * noise(5, 6.0)(p)
    return np.where(line[:, None], 0.65, grey[:, None] * [1.0, 0.98, 0.94]), 0 * grey, np.where(line, 0.6, 0.85)


def buildings(p, n):
    """Brick walls with rows of windows, tiles on what faces up; the block has a radius of one."""
    up = n[:, 1] > 0.35
    across = np.where(np.abs(n[:, 0]) > np.abs(n[:, 2]), p[:, 2], p[:, 0])
    window = ~up & (across % 0.06 < 0.028) & (p[:, 1] % 0.075 > 0.03) & (p[:, 1] % 0.075 < 0.065)
    tone = noise(6, 1.2)(p * [1.0, 0.0, 1.0])
    wall = blend([0.45, 0.2, 0.13], [0.66, 0.58, 0.46], np.clip(2.5 * tone - 0.75, 0, 1))
    roof = blend([0.3, 0.12, 0.08], [0.16, 0.16, 0.18], np.clip(3.0 * noise(7, 1.0)(p) - 1.0, 0, 1))
    base = np.where(up[:, None], roof, np.where(window[:, None], [0.05, 0.06, 0.07], wall))
    return base, 0 * tone, np.where(window, 0.25, np.where(up, 0.6, 0.8))


def marble(p, n):
    """The bunny: marble with gilded ears and paws."""
    veins = np.abs(np.sin(9.0 * p[:, 0] + 7.0 * noise(8, 2.5)(p) + 5.0 * p[:, 1]))
    gilded = noise(9, 1.6)(p) > 0.62
    base = np.where(gilded[:, None], [0.86, 0.62, 0.26], blend([0.74, 0.7, 0.66], [0.25, 0.3, 0.28], veins ** 8))
    return base, 1.0 * gilded, np.where(gilded, 0.38, 0.32)


def hide(p, n):
    spots = np.clip(12.0 * (noise(10, 2.2)(p) - 0.52), 0, 1)
    return blend([0.66, 0.6, 0.52], [0.16, 0.09, 0.05], spots), 0 * spots, 0.6 - 0.15 * spots


def glaze(p, n):
    """The teapot: glazed bands and a band of brass."""
    band = np.floor(7.0 * p[:, 1] + 0.15 * np.sin(6.0 * np.arctan2(p[:, 2], p[:, 0])))
    brass = band % 5 == 3
    base = np.where((band % 2 == 0)[:, None], [0.1, 0.22, 0.48], [0.72, 0.68, 0.58])
    base = np.where(brass[:, None], [0.78, 0.57, 0.3], base)
    return base, 1.0 * brass, np.where(brass, 0.45, 0.28 + 0.2 * noise(11, 2.0)(p))


def plush(p, n):
    belly = (p[:, 2] > 0.22) & (np.hypot(p[:, 0], p[:, 1] - 0.7) < 0.32)
    fur = 0.7 + 0.6 * noise(12, 7.0)(p)[:, None]
    return np.where(belly[:, None], [0.66, 0.52, 0.34], [0.36, 0.2, 0.1]) * fur, 0 * p[:, 0], np.where(belly, 0.9, 0.7)


PROCEDURES = {"checker": checker, "planks": planks, "stone": stone, "asphalt": asphalt, "buildings": buildings,
              "bunny": marble, "cow": hide, "teapot": glaze, "teddy": plush}


def finish_of(mi, part, data):
    """A function of (positions, normals, uvs) that gives (base, metal, roughness)."""
    if isinstance(part["finish"], tuple):
        colour, packed = Picture(mi, part["finish"][0], True), Picture(mi, part["finish"][1], False)

        def of_files(p, n, uvs):
            both = packed.at(uvs)
            return colour.at(uvs), both[:, 2], both[:, 1]

        return of_files
    if part["finish"] == "spot":
        colour = Picture(mi, data / "meshes/spot_textured/spot_texture.png", True)
        return lambda p, n, uvs: (colour.at(uvs), 0 * p[:, 0], 0.3 + 0.25 * noise(13, 2.0)(p))
    procedure = PROCEDURES[part["finish"]]
    return lambda p, n, uvs: procedure(p, n)
