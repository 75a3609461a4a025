"""The reflection model of Patina as a BSDF of Mitsuba 3, named `patina`.

    import mitsuba as mi
    mi.set_variant("llvm_ad_rgb")
    import patina_lobe
    scene = mi.load_file("scene_exact.xml")

Any variant of the JIT works (`llvm_*`, `cuda_*`). Parameters are textures or constants: `diffuse` and `specular`
(F0) in linear RGB, `roughness` r = a^2 with a the microfacet width; `distribution` is `blinn-phong` or `ggx`.

    f = diffuse / pi + D F G / (4 cos_i cos_o),  F = F0 + (1 - F0) (1 - h.o)^5
    blinn-phong:
      D = (n.h)^e / (pi a^2),  e = 2 / a^2 - 2
      G / (4 cos_i cos_o) = 1 / (4 q(cos_i) q(cos_o)),  q(c) = c (1 - a / 2) + a / 2
    ggx:
      D = 1 / (pi a^2 t^2),  t = 1 + (1 / a^2 - 1) sin^2
      G / (4 cos_i cos_o) = 1 / (2 (cos_i R(cos_o) + cos_o R(cos_i))),  R(c)^2 = a^2 + (1 - a^2) c^2
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
        distribution = props.get("distribution", "blinn-phong")
        if distribution not in ("blinn-phong", "ggx"):
            raise ValueError(f"patina: no distribution is called {distribution}: blinn-phong or ggx")
        self.is_ggx = distribution == "ggx"
        where = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide | mi.BSDFFlags.SpatiallyVarying
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

    def distribution(self, squared_width, half):
        if self.is_ggx:
            sine_squared = half.x * half.x + half.y * half.y
            spread = 1.0 + (1.0 / squared_width - 1.0) * sine_squared
            return 1.0 / (dr.pi * squared_width * spread * spread)
        return dr.exp((2.0 / squared_width - 2.0) * self.log_cosine(half)) / (dr.pi * squared_width)

    def value(self, material, view, light):
        """The BSDF times the cosine of the light."""
        diffuse, f0, squared_width = material
        half = dr.normalize(view + light)
        if self.is_ggx:
            root = lambda cosine: dr.sqrt(squared_width + (1.0 - squared_width) * cosine * cosine)
            shadowing = 0.5 / dr.maximum(light.z * root(view.z) + view.z * root(light.z), 1e-12)
        else:
            k = 0.5 * dr.sqrt(squared_width)
            q = lambda cosine: cosine * (1.0 - k) + k
            shadowing = 0.25 / (q(view.z) * q(light.z))
        rise = dr.clip(1.0 - dr.dot(half, view), 0.0, 1.0) ** 5
        fresnel = f0 + (1.0 - f0) * rise
        lobe = fresnel * (self.distribution(squared_width, half) * shadowing)
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
        of_half = self.distribution(squared_width, half) * dr.maximum(half.z, 0.0)
        of_lobe = of_half / dr.maximum(4.0 * dr.dot(half, view), 1e-7)
        share = self.specular_share(material, view)
        return share * of_lobe + (1.0 - share) * light.z * dr.inv_pi

    @staticmethod
    def side(si):
        """1 where the front of the triangle is seen, -1 where its back is: both reflect alike."""
        return dr.select(dr.dot(si.to_local(si.n), si.wi) < 0, mi.Float(-1.0), mi.Float(1.0))

    @staticmethod
    def is_lit(si, view, light):
        # Both directions lie above the triangle too, not only above the smooth normal. They are mirrored on the back, so that
        # the normal is not.
        return (view.z > 0) & (light.z > 0) & (dr.dot(si.to_local(si.n), light) > 0)

    def sample(self, ctx, si, sample1, sample2, active=True):
        side = self.side(si)
        view = si.wi * side
        material = self.material(si, active)
        takes_lobe = sample1 < self.specular_share(material, view)
        squared_width = dr.detach(material[2])
        u = dr.minimum(sample2.x, 1.0 - 1e-7)
        if self.is_ggx:
            # tan^2 = a^2 u / (1 - u).
            sine_squared = u / (u + (1.0 - u) / squared_width)
            cosine, sine = dr.safe_sqrt(1.0 - sine_squared), dr.sqrt(sine_squared)
        else:
            # cos^(e + 1): ln cos = a^2 / 2 ln(1 - u).
            cosine = dr.exp(0.5 * squared_width * dr.log(1.0 - u))
            sine = dr.safe_sqrt(1.0 - cosine * cosine)
        sin_phi, cos_phi = dr.sincos(dr.two_pi * sample2.y)
        half = mi.Vector3f(sine * cos_phi, sine * sin_phi, cosine)
        mirrored = 2.0 * dr.dot(view, half) * half - view
        light = dr.select(takes_lobe, mirrored, mi.warp.square_to_cosine_hemisphere(sample2))
        active = active & self.is_lit(si, view, light)
        density = self.density(material, view, light)
        active &= density > 0
        drawn = dr.zeros(mi.BSDFSample3f)
        drawn.wo = light * side
        drawn.pdf = dr.select(active, density, 0.0)
        drawn.eta = 1.0
        drawn.sampled_type = dr.select(takes_lobe, mi.UInt32(+mi.BSDFFlags.GlossyReflection),
                                       mi.UInt32(+mi.BSDFFlags.DiffuseReflection))
        drawn.sampled_component = dr.select(takes_lobe, mi.UInt32(1), mi.UInt32(0))
        weight = self.value(material, view, light) / dr.maximum(dr.detach(density), 1e-30)
        return drawn, dr.select(active, weight, 0.0)

    def between(self, function, si, wo, active):
        side = self.side(si)
        view, light = si.wi * side, wo * side
        lit = active & self.is_lit(si, view, light)
        return dr.select(lit, function(self.material(si, active), view, light), 0.0)

    def eval(self, ctx, si, wo, active=True):
        return self.between(self.value, si, wo, active)

    def pdf(self, ctx, si, wo, active=True):
        return self.between(self.density, si, wo, active)

    def eval_pdf(self, ctx, si, wo, active=True):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def to_string(self):
        return "PatinaLobe"


mi.register_bsdf("patina", PatinaLobe)
