//! Parts of a surface that have measured reflectance in place of the maps'.

use crate::error::{Error, ErrorKind, Result};
use crate::image::{GreyImage, Image};
use crate::material::texels::texel_of_uv;
use crate::math::frame::Frame;
use crate::measured::coordinates::HalfDifference;
use crate::measured::model::ReflectanceModel;
use crate::measured::table::MeasuredBrdf;
use crate::neural::sampler::HalfVectorSampler;
use glam::{Vec2, Vec3};

/// A mask covers what is brighter than this.
pub const COVERED: f32 = 0.5;

/// Most materials of one surface.
const MOST_MATERIALS: usize = 255;

/// A measured reflectance, ready for a path tracer: the table and what draws directions by it.
#[derive(Clone, Debug)]
pub struct MeasuredMaterial {
    /// Its name.
    pub name: String,
    table: MeasuredBrdf,
    sampler: HalfVectorSampler,
}

/// A table as a model without parameters, for the sampler.
struct TableModel<'a>(&'a MeasuredBrdf);

impl ReflectanceModel for TableModel<'_> {
    fn name(&self) -> &str {
        "table"
    }
    fn parameter_count(&self) -> usize {
        0
    }
    fn start(&self) -> Vec<f64> {
        Vec::new()
    }
    fn evaluate(&self, _: &[f64], at: &[HalfDifference], values: &mut [[f64; 3]]) {
        for (value, &at) in values.iter_mut().zip(at) {
            *value = self.0.lookup(at).unwrap_or_default();
        }
    }
    fn pull_back(&self, _: &[f64], _: &[HalfDifference], _: &[[f64; 3]], _: &mut [f64]) {}
}

impl MeasuredMaterial {
    /// A material of a table. Its directions are drawn nearly by reflectance times cosine (a table over half vectors),
    /// with the density that belongs to them.
    pub fn new(name: &str, table: MeasuredBrdf) -> Self {
        let sampler = HalfVectorSampler::new(&TableModel(&table), &[]);
        MeasuredMaterial { name: name.into(), table, sampler }
    }

    /// Its reflectance.
    pub fn table(&self) -> &MeasuredBrdf {
        &self.table
    }

    /// `f(i, o) (n.i)` in 1/sr per channel, for unit directions in the outer space.
    pub fn reflect(&self, frame: &Frame, towards_light: Vec3, towards_viewer: Vec3) -> [f32; 3] {
        let [light, viewer] = [towards_light, towards_viewer].map(|outer| frame.local_from_outer(outer).as_dvec3());
        self.table.evaluate(light, viewer).map(|value| (value * light.z.max(0.0)) as f32)
    }

    /// A unit direction towards the light; `None` when it falls below the horizon. `numbers` are uniform in [0, 1).
    pub fn sample(&self, frame: &Frame, towards_viewer: Vec3, numbers: [f32; 3]) -> Option<Vec3> {
        let viewer = frame.local_from_outer(towards_viewer).as_dvec3().try_normalize()?;
        let (light, _) = self.sampler.sample(viewer, numbers)?;
        frame.outer_from_local(light.as_vec3()).try_normalize()
    }

    /// Density of [`MeasuredMaterial::sample`] per steradian.
    pub fn density(&self, frame: &Frame, towards_light: Vec3, towards_viewer: Vec3) -> f32 {
        let local = [towards_light, towards_viewer].map(|outer| frame.local_from_outer(outer).as_dvec3().normalize());
        self.sampler.density(local[1], local[0]) as f32
    }

    /// The share of light that leaves the surface, from the normal to the horizon: angle in radians, then RGB. Above 1 a
    /// table makes light of nothing, and paths of many bounces grow without end.
    pub fn albedos(&self) -> Vec<(f64, [f64; 3])> {
        self.sampler.albedos()
    }
}

/// Which part of the texture square has which measured material.
#[derive(Clone, Debug)]
pub struct Regions {
    materials: Vec<MeasuredMaterial>,
    /// 0 where the maps hold, else one more than the index of the material.
    labels: Image<u8>,
}

impl Regions {
    /// The whole surface of one material.
    pub fn everywhere(material: MeasuredMaterial) -> Self {
        Regions { materials: vec![material], labels: Image::filled(1, 1, 1) }
    }

    /// Materials with masks over the texture square: row 0 is `v = 1`, a material holds where its mask is above one
    /// half, the last one where masks overlap.
    ///
    /// # Errors
    /// No material or more than 255, masks of different sizes or without pixels.
    pub fn of_masks(parts: Vec<(MeasuredMaterial, GreyImage)>) -> Result<Self> {
        let refuse = |message: &str, remedy: &str| Err(Error::new(ErrorKind::InvalidSetting, message).remedy(remedy));
        let Some((_, first)) = parts.first() else {
            return refuse("no material is given", "name one with --material");
        };
        let (width, height) = (first.width(), first.height());
        if parts.len() > MOST_MATERIALS {
            return refuse("there are more than 255 materials", "leave some out");
        }
        if width * height == 0 || parts.iter().any(|(_, mask)| (mask.width(), mask.height()) != (width, height)) {
            return refuse(
                "the masks of the regions differ in size",
                "give masks of one size, such as that of the maps",
            );
        }
        let mut labels = Image::filled(width, height, 0u8);
        let mut materials = Vec::with_capacity(parts.len());
        for (index, (material, mask)) in parts.into_iter().enumerate() {
            for (label, value) in labels.pixels_mut().iter_mut().zip(mask.pixels()) {
                if *value > COVERED {
                    *label = index as u8 + 1;
                }
            }
            materials.push(material);
        }
        Ok(Regions { materials, labels })
    }

    /// The material at a texture coordinate, by the nearest texel; `None` where the maps hold.
    pub fn at(&self, uv: Vec2) -> Option<&MeasuredMaterial> {
        let label = self.labels[texel_of_uv(uv, self.labels.width(), self.labels.height())];
        self.materials.get(usize::from(label).checked_sub(1)?)
    }

    /// The materials.
    pub fn materials(&self) -> &[MeasuredMaterial] {
        &self.materials
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_are_read_in_the_order_of_textures() {
        let material = |name: &str| MeasuredMaterial::new(name, MeasuredBrdf::from_fn(|_| [0.1; 3]));
        let mask = |row: usize, column: usize| {
            Image::from_fn(2, 2, move |r, c| if (r, c) == (row, column) { 1.0f32 } else { 0.0 })
        };
        let parts = vec![(material("a"), mask(0, 0)), (material("b"), mask(1, 1))];
        let regions = Regions::of_masks(parts).unwrap();
        let name = |u: f32, v: f32| regions.at(Vec2::new(u, v)).map(|own| own.name.as_str());
        // Row 0 is the top, v = 1.
        assert_eq!([name(0.2, 0.9), name(0.9, 0.1)], [Some("a"), Some("b")]);
        assert_eq!([name(0.9, 0.9), name(0.2, 0.1)], [None, None]);
        assert_eq!([name(-3.0, 7.0), name(f32::NAN, 7.0)], [Some("a"), Some("a")]);
        assert!(Regions::of_masks(Vec::new()).is_err());
        let parts = vec![(material("a"), mask(0, 0)), (material("b"), Image::filled(3, 2, 1.0))];
        assert!(Regions::of_masks(parts).unwrap_err().message().contains("size"));
    }
}
