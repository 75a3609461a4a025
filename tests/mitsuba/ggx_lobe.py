"""A lobe of another kind than Patina fits, as a Mitsuba BSDF called `ggx`, for photos that the model cannot quite say.

    D = a^2 / (pi ((n.h)^2 (a^2 - 1) + 1)^2)                            Trowbridge-Reitz; Walter et al. 2007, eq. 33
    G = 1 / (1 + L(i) + L(o)),  L(c) = (sqrt(1 + a^2 (1 - c^2) / c^2) - 1) / 2   Smith, height-correlated; Heitz 2014

Schlick's Fresnel and the diffuse part are those of `modct`, and so are the textures: the third holds r = a^2.
"""
import drjit as dr
import mitsuba as mi

import modct


def lobe_class():
    class Lobe(modct.lobe_class()):
        def to_string(self):
            return "Lobe[ggx]"

        @staticmethod
        def distribution(r, h):
            # 1 - c^2 from the small components keeps its digits where the lobe is sharp.
            sine2 = dr.square(h.x) + dr.square(h.y)
            return r * dr.inv_pi / dr.square(dr.square(h.z) * r + sine2)

        def value_times_cosine(self, surface, i, o):
            rho_d, f0, r, _ = surface
            h = dr.normalize(i + o)
            slope = lambda a, b: a * dr.sqrt(dr.maximum(r + (1.0 - r) * dr.square(b), 1e-14))
            visibility = 0.5 / dr.maximum(slope(o.z, i.z) + slope(i.z, o.z), 1e-14)
            lobe = self.strength * self.distribution(r, h) * visibility
            return (rho_d * dr.inv_pi + self.schlick(f0, dr.dot(h, o)) * lobe) * o.z

        def density_of_half(self, surface, h):
            return self.distribution(dr.detach(surface[2]), h) * h.z

        def drawn_half(self, surface, uv):
            r = dr.detach(surface[2])
            cosine2 = (1.0 - uv.y) / (1.0 + (r - 1.0) * uv.y)
            return dr.safe_sqrt(1.0 - cosine2), dr.sqrt(dr.maximum(cosine2, 0.0)), dr.two_pi * uv.x

    return Lobe


def register():
    """Makes `ggx` known to the variant that is set."""
    mi.register_bsdf("ggx", lobe_class())
