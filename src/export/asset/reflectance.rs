//! Reflectance in the terms of other renderers: diffuse light under Fresnel's factor, an index of refraction with a colour, base
//! colour with metalness.

use super::Asset;
use crate::export::between_facets::f0_without;
use crate::image::{GreyImage, Image, RgbImage};
use glam::Vec3;

/// Mean of Schlick's `(1 - h.o)^5` over both directions by their cosines: what glTF weighs diffuse light by.
pub const GRAZING_OF_HALF_VECTORS: f32 = 0.0037;
/// Mean of `(1 - n.o)^5` over one direction by its cosine, 1/21: what layered models (Cycles, OpenPBR) weigh it by.
pub const GRAZING_OF_VIEWS: f32 = 1.0 / 21.0;
/// The least largest F0 that an index is chosen for: the default dielectric of every renderer.
const LEAST_F0: f32 = 0.04;

/// The largest F0 of paint and plastic in the metalness workflow of Unreal and others: "specular" 1.
pub const LARGEST_SPECULAR: f32 = 0.08;
/// F0 above which a texel speaks for metals: no common dielectric but gems reflects so much.
const METAL_F0: f32 = 0.16;
/// The index of refraction that colours of F0 are written over where a renderer lays the lobe over its diffuse part by the
/// index alone (Cycles): at that of the largest F0 it takes more from diffuse light at grazing angles than the lobe gives.
/// Readers that follow the text of glTF have Schlick's rise whatever the index.
pub const LOW_IOR: f64 = 1.3;

/// F0 in the words of a dielectric.
#[derive(Clone, Debug, PartialEq)]
pub struct Dielectric {
    /// Index of refraction, at least 1.5: that of the largest F0.
    pub ior: f64,
    /// `F0 / F0(ior)`, linear RGB in [0, 1].
    pub colour: RgbImage,
}

/// Base colour and metalness in place of diffuse and specular reflectance.
#[derive(Clone, Debug, PartialEq)]
pub struct MetalSplit {
    /// Diffuse reflectance of what is no metal, F0 of what is; linear RGB in [0, 1].
    pub base_colour: RgbImage,
    /// Share of metal in [0, 1].
    pub metallic: GreyImage,
    /// Luminance of the F0 of what is no metal over its largest, [`MetalSplit::dielectric_f0`], in [0, 1].
    pub specular: GreyImage,
    /// The same in colour.
    pub specular_colour: RgbImage,
    /// The largest F0 of what is no metal.
    pub dielectric_f0: f32,
    /// Root mean squared error of F0 over texels and channels.
    pub error_f0: f64,
    /// Root mean squared error of the diffuse reflectance.
    pub error_diffuse: f64,
}

/// How the F0 of what is no metal may vary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DielectricRange {
    /// From 0 to this, by a map of its own.
    UpTo(f32),
    /// One F0 everywhere.
    Always(f32),
}

impl Asset {
    /// The base colour for a renderer that lays a lobe over its diffuse part, by [`MetalSplit::base_colour_under_fresnel`] where
    /// metals are set apart and by [`Asset::diffuse_under_fresnel`] where they are not. The second value is the share of texels
    /// held at 1.
    pub fn base_colour_beside(
        &self,
        metals: Option<&MetalSplit>,
        grazing: f32,
        perceptual_roughness: Option<&GreyImage>,
    ) -> (RgbImage, f64) {
        match metals {
            Some(split) => split.base_colour_under_fresnel(grazing, perceptual_roughness),
            None => self.diffuse_under_fresnel(grazing),
        }
    }

    /// F0 of what is no metal, of all where metals are not set apart.
    pub fn dielectric_beside(&self, metals: Option<&MetalSplit>) -> Dielectric {
        match metals {
            Some(split) => Dielectric { ior: split.ior(), colour: split.specular_colour.clone() },
            None => self.dielectric(),
        }
    }

    /// Reflectance F0 as an index of refraction and a colour at most 1 that F0 of that index is multiplied by.
    pub fn dielectric(&self) -> Dielectric {
        let largest = self.maps.specular.pixels().iter().map(|f0| f0.max_element()).fold(0.0, f32::max);
        let f0 = largest.clamp(LEAST_F0, 0.98);
        let scale = 1.0 / f0;
        Dielectric { ior: ior_of(f0), colour: self.maps.specular.map(|specular| (*specular * scale).min(Vec3::ONE)) }
    }

    /// The diffuse map for a renderer that weighs its diffuse part by one minus a mean of Fresnel's factor: divided by
    /// that. `grazing` is the mean of Schlick's `(1 - cos)^5` over the directions the renderer takes it at. The second
    /// value is the share of texels that would exceed 1 and are held there.
    pub fn diffuse_under_fresnel(&self, grazing: f32) -> (RgbImage, f64) {
        if !self.has_lobe {
            return (self.maps.diffuse.clone(), 0.0);
        }
        let mut held = 0usize;
        let pixels = self.maps.diffuse.pixels().iter().zip(self.maps.specular.pixels());
        let pixels: Vec<Vec3> = pixels
            .map(|(diffuse, specular)| {
                let f0 = specular.max_element();
                let raised = *diffuse / (1.0 - (f0 + (1.0 - f0) * grazing)).max(0.02);
                held += usize::from(raised.max_element() > 1.0);
                raised.min(Vec3::ONE)
            })
            .collect();
        let share = held as f64 / pixels.len().max(1) as f64;
        (Image::from_pixels(self.maps.diffuse.width(), self.maps.diffuse.height(), pixels), share)
    }

    /// Diffuse and specular reflectance as base colour and metalness: with `u` the share that is no metal and `d` its
    /// F0, luminances give `(1 - u) base + u d = F0` and `u base = diffuse`, a quadratic in `u` (as the conversion of
    /// specular-glossiness of the glTF working group, with `d` for its 0.04).
    pub fn metal_split(&self, range: DielectricRange) -> MetalSplit {
        let (width, height) = (self.maps.diffuse.width(), self.maps.diffuse.height());
        let count = width * height;
        let mut base_colour = Vec::with_capacity(count);
        let mut metallic = Vec::with_capacity(count);
        let mut specular = Vec::with_capacity(count);
        let mut specular_colour = Vec::with_capacity(count);
        let (largest, varies) = match range {
            DielectricRange::UpTo(most) => (most, true),
            DielectricRange::Always(f0) => (f0, false),
        };
        let (mut squared_f0, mut squared_diffuse) = (0.0f64, 0.0f64);
        for (&diffuse, &f0) in self.maps.diffuse.pixels().iter().zip(self.maps.specular.pixels()) {
            let (bright_diffuse, bright_f0) = (crate::math::luminance(diffuse), crate::math::luminance(f0));
            let (share, level) = if !self.has_lobe {
                (1.0, 0.0)
            } else if bright_f0 <= largest {
                (1.0, if varies { bright_f0 / largest.max(1e-6) } else { 1.0 })
            } else {
                (dielectric_share(bright_diffuse, bright_f0, largest), 1.0)
            };
            let metal = 1.0 - share;
            let from_diffuse = diffuse / share.max(1e-4);
            let from_f0 = (f0 - Vec3::splat(share * level * largest)) / metal.max(1e-4);
            let base = from_diffuse.lerp(from_f0, metal * metal).clamp(Vec3::ZERO, Vec3::ONE);
            squared_diffuse += f64::from((base * share - diffuse).length_squared());
            squared_f0 += f64::from((base * metal + Vec3::splat(share * level * largest) - f0).length_squared());
            base_colour.push(base);
            metallic.push(metal);
            specular.push(level);
            let whole = metal > 0.0 || !varies;
            specular_colour.push(if whole { Vec3::splat(level) } else { (f0 / largest.max(1e-6)).min(Vec3::ONE) });
        }
        let root = |squared: f64| (squared / (3 * count.max(1)) as f64).sqrt();
        MetalSplit {
            base_colour: Image::from_pixels(width, height, base_colour),
            metallic: Image::from_pixels(width, height, metallic),
            specular: Image::from_pixels(width, height, specular),
            specular_colour: Image::from_pixels(width, height, specular_colour),
            dielectric_f0: largest,
            error_f0: if self.has_lobe { root(squared_f0) } else { 0.0 },
            error_diffuse: root(squared_diffuse),
        }
    }

    /// Base colour and metalness for formats of the metalness workflow that take a colour of F0 as well: where the surface
    /// has metals. An index of refraction that stands for a metal's F0 would spoil the rise towards grazing angles of all
    /// that is no metal.
    pub fn metals(&self) -> Option<MetalSplit> {
        let brightest = || self.maps.specular.pixels().iter().filter(|f0| f0.max_element() > METAL_F0).count();
        let has_metals = self.has_lobe && brightest() * 1000 > self.maps.specular.pixels().len();
        has_metals.then(|| self.metal_split(DielectricRange::UpTo(LARGEST_SPECULAR)))
    }
}

/// The index of refraction of an F0.
pub fn ior_of(f0: f32) -> f64 {
    let root = f64::from(f0).sqrt();
    (1.0 + root) / (1.0 - root)
}

/// F0 of an index of refraction (Fresnel's equations at normal incidence).
pub fn f0_of(ior: f64) -> f64 {
    ((ior - 1.0) / (ior + 1.0)).powi(2)
}

impl MetalSplit {
    /// Index of refraction of the largest F0 of what is no metal.
    pub fn ior(&self) -> f64 {
        ior_of(self.dielectric_f0)
    }

    /// The base colour for a renderer that weighs diffuse light by one minus a mean of Fresnel's factor, as
    /// [`Asset::diffuse_under_fresnel`]. With `perceptual_roughness`, for one that adds light between microfacets, metals are
    /// lowered by that ([`f0_without`]); else they are left as they are. The second value is the share of texels held at 1.
    pub fn base_colour_under_fresnel(&self, grazing: f32, perceptual_roughness: Option<&GreyImage>) -> (RgbImage, f64) {
        let mut held = 0usize;
        let texels = self.base_colour.pixels().iter().zip(self.metallic.pixels()).zip(self.specular_colour.pixels());
        let pixels: Vec<Vec3> = texels
            .enumerate()
            .map(|(index, ((base, metal), colour))| {
                let f0 = colour.max_element() * self.dielectric_f0;
                let factor = 1.0 / (1.0 - (f0 + (1.0 - f0) * grazing));
                let of_metal = match perceptual_roughness {
                    Some(roughness) if *metal > 0.0 => f0_without(*base, roughness.pixels()[index].powi(2)),
                    _ => *base,
                };
                let raised = *base * (factor * (1.0 - metal)) + of_metal * *metal;
                held += usize::from(raised.max_element() > 1.0);
                raised.min(Vec3::ONE)
            })
            .collect();
        let share = held as f64 / pixels.len().max(1) as f64;
        (Image::from_pixels(self.base_colour.width(), self.base_colour.height(), pixels), share)
    }
}

impl Dielectric {
    /// What [`Dielectric::colour`] is multiplied by so that F0 is the same over another index.
    pub fn factor_over(&self, ior: f64) -> f32 {
        (f0_of(self.ior) / f0_of(ior)) as f32
    }
}

/// The share that is no metal: the smaller root of `d u^2 - (F0 + diffuse) u + diffuse = 0`, for `F0 > d`.
fn dielectric_share(diffuse: f32, f0: f32, dielectric: f32) -> f32 {
    let (diffuse, f0, dielectric) = (f64::from(diffuse), f64::from(f0), f64::from(dielectric));
    let sum = diffuse + f0;
    let root = (sum * sum - 4.0 * dielectric * diffuse).max(0.0).sqrt();
    // 2 c / (b + root) keeps its digits for a small d.
    (2.0 * diffuse / (sum + root).max(1e-9)).clamp(0.0, 1.0) as f32
}

#[cfg(test)]
mod tests {
    use super::super::tests::small_asset;
    use super::*;

    #[test]
    fn a_dielectric_says_the_same_f0() {
        let asset = small_asset(true);
        let Dielectric { ior, colour } = asset.dielectric();
        let f0 = f0_of(ior) as f32;
        for (colour, specular) in colour.pixels().iter().zip(asset.maps.specular.pixels()) {
            assert!((*colour * f0 - *specular).abs().max_element() < 1e-5);
        }
        let low = f0_of(LOW_IOR) as f32;
        assert!((asset.dielectric().factor_over(LOW_IOR) * low - f0).abs() < 1e-6);
    }

    #[test]
    fn metals_and_paints_survive_the_split() {
        let mut asset = small_asset(true);
        asset.maps.diffuse = Image::from_pixels(3, 1, vec![Vec3::splat(0.5), Vec3::ZERO, Vec3::splat(0.3)]);
        let gold = Vec3::new(0.9, 0.7, 0.3);
        asset.maps.specular = Image::from_pixels(3, 1, vec![Vec3::splat(0.04), gold, Vec3::splat(0.3)]);
        let split = asset.metal_split(DielectricRange::UpTo(0.08));
        assert_eq!((split.metallic[(0, 0)], split.specular[(0, 0)]), (0.0, 0.5));
        assert!((split.metallic[(0, 1)] - 1.0).abs() < 1e-6 && (split.base_colour[(0, 1)] - gold).length() < 1e-5);
        assert!(split.metallic[(0, 2)] > 0.2 && split.metallic[(0, 2)] < 0.9);
        assert!(split.error_f0 < 1e-4 && split.error_diffuse < 1e-4, "{split:?}");
        // One F0 for all paints: what is below it is lost, and told.
        let fixed = asset.metal_split(DielectricRange::Always(0.1));
        assert!(fixed.error_f0 > 0.01);
    }

    #[test]
    fn diffuse_light_is_raised_by_what_a_layer_takes() {
        let (raised, held) = small_asset(true).diffuse_under_fresnel(GRAZING_OF_VIEWS);
        let asset = small_asset(true);
        let f0 = asset.maps.specular[(5, 5)].max_element();
        let expected = asset.maps.diffuse[(5, 5)] / (1.0 - f0 - (1.0 - f0) / 21.0);
        assert!((raised[(5, 5)] - expected).length() < 1e-6);
        // With F0 = (1 + row / 15) / 20 at most, what is brighter than 20 (1 - F0) / 21 is held. The chart has texels 1 to 14 of
        // rows and columns, and what lies outside takes the nearest of them. The red channel, row / 15, is held in rows 13
        // and 14 (0.867 beyond 0.863), so in three rows of the map; in the other thirteen the blue one, column / 15, is held
        // in column 14 alone (0.933 beyond at most 0.902; column 13 of row 12 comes to 1 exactly), so in two columns.
        assert_eq!(held, f64::from(3 * 16 + 13 * 2) / 256.0);
        assert_eq!(small_asset(false).diffuse_under_fresnel(0.1).1, 0.0);
    }
}
