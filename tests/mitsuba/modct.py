"""Patina's reflection lobe as a Mitsuba 3 BSDF called `modct`.

    f = rho_d / pi + D F G / (4 (n.i) (n.o))                            no cosine, zero unless n.i > 0 and n.o > 0
    D = (e + 2) / (2 pi) (n.h)^e,  e = 2 / r - 2,  r = a^2              normalized Blinn-Phong
    F = F0 + (1 - F0) (1 - h.o)^5                                       Schlick 1994
    G = g(n.i) g(n.o),  g(c) = c / (c (1 - k) + k),  k = a / 2          Smith product of Schlick's approximation

`r` is what roughness.exr holds. `lobe_strength` scales the second term: 0 takes the lobe away as a whole, which F0 = 0
does not. With `log_width` the third texture holds ln a instead of r, so that ln a is what a bilinear tap blends. The
cosines of G cancel those below the fraction, so nothing is divided by a cosine.

A direction is drawn from a mixture: cosine-weighted about n, or a half vector with density D (n.h) which reflects i.
Nothing in the mixture carries a derivative; the value of f does.
"""
import drjit as dr
import mitsuba as mi

SMALLEST_ROUGHNESS = 2.5e-5


def lobe_class():
    """The class, made late: `mi.BSDF` depends on the variant that is set."""

    class Lobe(mi.BSDF):
        def __init__(self, properties):
            super().__init__(properties)
            self.diffuse = properties.get_texture("diffuse", 0.5)
            self.specular = properties.get_texture("specular", 0.04)
            self.roughness = properties.get_texture("roughness", 0.5)
            self.strength = float(properties.get("lobe_strength", 1.0))
            self.log_width = bool(properties.get("log_width", False))
            side = mi.BSDFFlags.FrontSide | mi.BSDFFlags.SpatiallyVarying
            self.m_components = [mi.BSDFFlags.DiffuseReflection | side, mi.BSDFFlags.GlossyReflection | side]
            self.m_flags = self.m_components[0] | self.m_components[1]

        def traverse(self, callback):
            for name in ("diffuse", "specular", "roughness"):
                callback.put(name, getattr(self, name), mi.ParamFlags.Differentiable)

        def to_string(self):
            return "Lobe[modct]"

        def surface(self, si, active):
            """(rho_d, F0, r, e) at the hit."""
            stored = self.roughness.eval_1(si, active)
            r = dr.clip(dr.exp(2.0 * stored) if self.log_width else stored, SMALLEST_ROUGHNESS, 1.0)
            return self.diffuse.eval(si, active), self.specular.eval(si, active), r, 2.0 / r - 2.0

        @staticmethod
        def power_of_cosine(h, e):
            """(n.h)^e. For sharp lobes 1 - (n.h)^2 is taken from the small components of h, which keeps its digits."""
            sine2 = dr.square(h.x) + dr.square(h.y)
            series = -sine2 * (1.0 + sine2 * (0.5 + sine2 * (1.0 / 3.0)))
            log_cosine2 = dr.select(sine2 < 0.01, series, dr.log(dr.maximum(1.0 - sine2, 1e-14)))
            return dr.exp(0.5 * e * log_cosine2)

        @staticmethod
        def schlick(f0, cosine):
            x = dr.clip(1.0 - cosine, 0.0, 1.0)
            return f0 + (1.0 - f0) * (dr.square(dr.square(x)) * x)

        def value_times_cosine(self, surface, i, o):
            rho_d, f0, r, e = surface
            h = dr.normalize(i + o)
            k = 0.5 * dr.sqrt(r)
            d = (e + 2.0) * dr.inv_two_pi * self.power_of_cosine(h, e)
            visibility = 0.25 / ((i.z * (1.0 - k) + k) * (o.z * (1.0 - k) + k))
            return (rho_d * dr.inv_pi + self.schlick(f0, dr.dot(h, o)) * (self.strength * d * visibility)) * o.z

        def share_of_specular(self, surface, i):
            """Probability of drawing a half vector, kept off 0 and 1 so that both parts stay covered."""
            rho_d, f0, _, _ = [dr.detach(x) for x in surface]
            s, d = self.strength * mi.luminance(self.schlick(f0, i.z)), mi.luminance(rho_d)
            return dr.clip(s / dr.maximum(s + d, 1e-6), 0.15 if self.strength > 0.0 else 0.0, 0.85)

        def density_of_half(self, surface, h):
            e = dr.detach(surface[3])
            return (e + 2.0) * dr.inv_two_pi * self.power_of_cosine(h, e) * h.z

        def drawn_half(self, surface, uv):
            """Sine, cosine and azimuth of a half vector: inverts the distribution of n.h, 1 - c^(e + 2)."""
            e = dr.detach(surface[3])
            cosine2 = dr.exp(2.0 * dr.log(dr.maximum(uv.y, 1e-12)) / (e + 2.0))
            return dr.safe_sqrt(1.0 - cosine2), dr.sqrt(cosine2), dr.two_pi * uv.x

        def density(self, surface, i, o):
            h = dr.normalize(i + o)
            share, half = self.share_of_specular(surface, i), self.density_of_half(surface, h)
            return (1.0 - share) * o.z * dr.inv_pi + share * half / dr.maximum(4.0 * dr.dot(h, o), 1e-8)

        def eval_pdf(self, context, si, wo, active=True):
            active &= (si.wi.z > 0.0) & (wo.z > 0.0)
            surface = self.surface(si, active)
            value = self.value_times_cosine(surface, si.wi, wo)
            return dr.select(active, value, 0.0), dr.select(active, self.density(surface, si.wi, wo), 0.0)

        def eval(self, context, si, wo, active=True):
            return self.eval_pdf(context, si, wo, active)[0]

        def pdf(self, context, si, wo, active=True):
            return self.eval_pdf(context, si, wo, active)[1]

        def sample(self, context, si, which, uv, active=True):
            surface = self.surface(si, active)
            glossy = which < self.share_of_specular(surface, si.wi)
            sine, cosine, azimuth = self.drawn_half(surface, uv)
            sin_phi, cos_phi = dr.sincos(azimuth)
            h = mi.Vector3f(sine * cos_phi, sine * sin_phi, cosine)
            mirrored = 2.0 * dr.dot(si.wi, h) * h - si.wi
            wo = dr.detach(dr.select(glossy, mirrored, mi.warp.square_to_cosine_hemisphere(uv)))
            value, density = self.eval_pdf(context, si, wo, active)
            active &= (si.wi.z > 0.0) & (wo.z > 0.0) & (density > 0.0)
            result = dr.zeros(mi.BSDFSample3f)
            result.wo = wo
            result.eta = 1.0
            result.pdf = dr.select(active, density, 0.0)
            result.sampled_component = dr.select(glossy, mi.UInt32(1), mi.UInt32(0))
            kinds = mi.BSDFFlags.GlossyReflection, mi.BSDFFlags.DiffuseReflection
            result.sampled_type = dr.select(glossy, mi.UInt32(+kinds[0]), mi.UInt32(+kinds[1]))
            return result, dr.select(active, value / dr.maximum(density, 1e-20), 0.0)

    return Lobe


def register():
    """Makes `modct` known to the variant that is set."""
    mi.register_bsdf("modct", lobe_class())
