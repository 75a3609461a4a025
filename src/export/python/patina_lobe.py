"""The reflection model of Patina as a BSDF of Mitsuba 3, named `patina`.

    import mitsuba as mi
    mi.set_variant("llvm_ad_rgb")
    import patina_lobe
    scene = mi.load_file("scene_exact.xml")

Any variant of the JIT works (`llvm_*`, `cuda_*`). Parameters are textures or constants: `diffuse` and `specular`
(F0) in linear RGB, `roughness` r = a^2 with a the microfacet width.

    f = diffuse / pi + D F G / (4 cos_i cos_o)
    D = (n.h)^e / (pi a^2),  e = 2 / a^2 - 2                  normalised Blinn-Phong
    F = F0 + (1 - F0) (1 - h.o)^5                            Schlick
    G / (4 cos_i cos_o) = 1 / (4 q(cos_i) q(cos_o)),  q(c) = c (1 - a / 2) + a / 2
"""
import drjit as dr
import mitsuba as mi

LEAST_ROUGHNESS = 0.005**2
SMALLEST_SHARE = 0.1


class PatinaLobe(mi.BSDF):
    def __init__(self, props):
        super().__init__(props)
        self.diffuse = props.get_texture("diffuse", 0.5)
        self.specular = props.get_texture("specular", 0.04)
        self.roughness = props.get_texture("roughness", 0.5)
        where = mi.BSDFFlags.FrontSide | mi.BSDFFlags.SpatiallyVarying
        self.m_components = [mi.BSDFFlags.DiffuseReflection | where, mi.BSDFFlags.GlossyReflection | where]
        self.m_flags = self.m_components[0] | self.m_components[1]

    def traverse(self, callback):
        for name in ("diffuse", "specular", "roughness"):
            callback.put(name, getattr(self, name), mi.ParamFlags.Differentiable)

    def material(self, si, active):
        squared_width = dr.clip(self.roughness.eval_1(si, active), LEAST_ROUGHNESS, 1.0)
        return self.diffuse.eval(si, active), self.specular.eval(si, active), squared_width

    @staticmethod
    def log_cosine(half):
        """ln(n.h) from the sine: it keeps its digits where the lobe is narrow."""
        sine_squared = dr.minimum(half.x * half.x + half.y * half.y, 1.0 - 1e-7)
        # A short series where 1 - sin^2 rounds to 1.
        exact = 0.5 * dr.log(1.0 - sine_squared)
        series = -0.5 * sine_squared * (1.0 + sine_squared * (0.5 + sine_squared / 3.0))
        return dr.select(sine_squared < 1e-2, series, exact)

    def value(self, material, view, light):
        """The BSDF times the cosine of the light."""
        diffuse, f0, squared_width = material
        half = dr.normalize(view + light)
        distribution = dr.exp((2.0 / squared_width - 2.0) * self.log_cosine(half)) / (dr.pi * squared_width)
        k = 0.5 * dr.sqrt(squared_width)
        q = lambda cosine: cosine * (1.0 - k) + k
        rise = dr.clip(1.0 - dr.dot(half, view), 0.0, 1.0) ** 5
        fresnel = f0 + (1.0 - f0) * rise
        lobe = fresnel * (distribution / (4.0 * q(view.z) * q(light.z)))
        return (diffuse * dr.inv_pi + lobe) * light.z

    def specular_share(self, material, view):
        diffuse, f0, _ = material
        rise = dr.clip(1.0 - view.z, 0.0, 1.0) ** 5
        specular = mi.luminance(f0 + (1.0 - f0) * rise)
        share = specular / dr.maximum(specular + mi.luminance(diffuse), 1e-6)
        return dr.detach(dr.clip(share, SMALLEST_SHARE, 1.0 - SMALLEST_SHARE))

    def density(self, material, view, light):
        squared_width = dr.detach(material[2])
        half = dr.normalize(view + light)
        of_half = dr.exp((2.0 / squared_width - 1.0) * self.log_cosine(half)) / (dr.pi * squared_width)
        of_lobe = of_half / dr.maximum(4.0 * dr.dot(half, view), 1e-7)
        share = self.specular_share(material, view)
        return share * of_lobe + (1.0 - share) * light.z * dr.inv_pi

    def is_lit(self, view, light):
        return (view.z > 0) & (light.z > 0)

    def sample(self, ctx, si, sample1, sample2, active=True):
        view = si.wi
        material = self.material(si, active)
        takes_lobe = sample1 < self.specular_share(material, view)
        # cos^(e + 1): ln cos = a^2 / 2 ln(1 - u).
        squared_width = dr.detach(material[2])
        cosine = dr.exp(0.5 * squared_width * dr.log(1.0 - dr.minimum(sample2.x, 1.0 - 1e-7)))
        sine = dr.safe_sqrt(1.0 - cosine * cosine)
        sin_phi, cos_phi = dr.sincos(dr.two_pi * sample2.y)
        half = mi.Vector3f(sine * cos_phi, sine * sin_phi, cosine)
        mirrored = 2.0 * dr.dot(view, half) * half - view
        light = dr.select(takes_lobe, mirrored, mi.warp.square_to_cosine_hemisphere(sample2))
        active = active & self.is_lit(view, light)
        density = self.density(material, view, light)
        active &= density > 0
        drawn = dr.zeros(mi.BSDFSample3f)
        drawn.wo = light
        drawn.pdf = dr.select(active, density, 0.0)
        drawn.eta = 1.0
        drawn.sampled_type = dr.select(takes_lobe, mi.UInt32(+mi.BSDFFlags.GlossyReflection),
                                       mi.UInt32(+mi.BSDFFlags.DiffuseReflection))
        drawn.sampled_component = dr.select(takes_lobe, mi.UInt32(1), mi.UInt32(0))
        weight = self.value(material, view, light) / dr.maximum(dr.detach(density), 1e-30)
        return drawn, dr.select(active, weight, 0.0)

    def eval(self, ctx, si, wo, active=True):
        return dr.select(active & self.is_lit(si.wi, wo), self.value(self.material(si, active), si.wi, wo), 0.0)

    def pdf(self, ctx, si, wo, active=True):
        return dr.select(active & self.is_lit(si.wi, wo), self.density(self.material(si, active), si.wi, wo), 0.0)

    def eval_pdf(self, ctx, si, wo, active=True):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def to_string(self):
        return "PatinaLobe"


mi.register_bsdf("patina", PatinaLobe)
