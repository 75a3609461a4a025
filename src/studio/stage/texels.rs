//! From images to textures: half precision, a mip chain that leaves out what means nothing, no larger than allowed.
//!
//! Made in parallel on whatever thread asks; a 2048 x 2048 map takes a fraction of a second, so the window asks from
//! another thread (see [`super::slot`]).

use crate::error::{Finding, Severity};
use crate::image::display::NOT_FINITE;
use crate::image::{GreyImage, Image, RgbImage, resize};
use crate::material::MaterialMaps;
use crate::math::parallel;
use eframe::wgpu;
use half::f16;
use rayon::prelude::*;
use std::borrow::Cow;

/// Largest number that half precision holds.
const LARGEST: f32 = 65504.0;
/// Fewer rows than this are not worth a task of their own.
const ROWS_PER_TASK: usize = 16;

/// A texture and how to look at all of it.
#[derive(Debug)]
pub(super) struct GpuTexture {
    /// The view of all levels.
    pub view: wgpu::TextureView,
    /// Width and height of the largest level.
    pub size: [u32; 2],
}

/// Numbers of a texel, and how much it means in the filters: 0 is nothing at all.
type Weighted = ([f32; 4], f32);

/// A table of texels in half precision.
struct Level {
    width: usize,
    height: usize,
    texels: Vec<Weighted>,
}

impl Level {
    /// The level of half the sides, each texel the weighted mean of those under it.
    fn coarser(&self) -> Level {
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let mut texels = vec![([0.0; 4], 0.0); width * height];
        each_row(&mut texels, width, &|row, pixels| {
            let rows = [2 * row, (2 * row + 1).min(self.height - 1)];
            for (column, (sum, weights)) in pixels.iter_mut().enumerate() {
                let columns = [2 * column, (2 * column + 1).min(self.width - 1)];
                for place in rows.iter().flat_map(|row| columns.map(|column| row * self.width + column)) {
                    let (value, weight) = self.texels[place];
                    for channel in 0..4 {
                        sum[channel] += value[channel] * weight;
                    }
                    *weights += weight;
                }
                let scale = if *weights > 0.0 { 1.0 / *weights } else { 0.0 };
                *sum = sum.map(|value| value * scale);
                *weights *= 0.25;
            }
        });
        Level { width, height, texels }
    }

    /// Gives texels without meaning the value of the coarser level, so that filters at the border of a chart stay in it.
    fn fill_from(&mut self, coarser: &Level) {
        each_row(&mut self.texels, self.width, &|row, pixels| {
            let above = (row / 2).min(coarser.height - 1) * coarser.width;
            for (column, (value, weight)) in pixels.iter_mut().enumerate() {
                if *weight <= 0.0 {
                    *value = coarser.texels[above + (column / 2).min(coarser.width - 1)].0;
                }
            }
        });
    }

    fn halves(&self) -> Vec<[f16; 4]> {
        let half = |value: f32| f16::from_f32(value.clamp(-LARGEST, LARGEST));
        self.texels.par_iter().with_min_len(4096).map(|(value, _)| value.map(half)).collect()
    }
}

fn each_row(texels: &mut [Weighted], width: usize, body: &(dyn Fn(usize, &mut [Weighted]) + Sync)) {
    parallel::each_chunk(texels, width * ROWS_PER_TASK, &|task, texels| {
        (task * ROWS_PER_TASK..).zip(texels.chunks_mut(width)).for_each(|(row, texels)| body(row, texels));
    });
}

/// What textures are made with.
#[derive(Clone)]
pub(super) struct Maker {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
}

impl Maker {
    /// Largest side of a texture here.
    fn largest_side(&self) -> usize {
        self.device.limits().max_texture_dimension_2d as usize
    }

    /// A texture of layers of the same size, each given as its levels.
    fn upload(&self, label: &str, layers: &[Vec<Level>], dimension: wgpu::TextureViewDimension) -> GpuTexture {
        let first = &layers[0][0];
        let size = [first.width as u32, first.height as u32];
        let texture = self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: layers.len() as u32 },
            mip_level_count: layers[0].len() as u32,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba16Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        for (layer, levels) in layers.iter().enumerate() {
            for (mip_level, level) in levels.iter().enumerate() {
                let (width, height) = (level.width as u32, level.height as u32);
                self.queue.write_texture(
                    wgpu::TexelCopyTextureInfo {
                        texture: &texture,
                        mip_level: mip_level as u32,
                        origin: wgpu::Origin3d { x: 0, y: 0, z: layer as u32 },
                        aspect: wgpu::TextureAspect::All,
                    },
                    bytemuck::cast_slice(&level.halves()),
                    wgpu::TexelCopyBufferLayout {
                        offset: 0,
                        bytes_per_row: Some(8 * width),
                        rows_per_image: Some(height),
                    },
                    wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                );
            }
        }
        let view =
            texture.create_view(&wgpu::TextureViewDescriptor { dimension: Some(dimension), ..Default::default() });
        GpuTexture { view, size }
    }

    /// A texture of `texel(index)` with a full mip chain; `has_holes` fills texels of weight 0 from their neighbours.
    fn mipped(
        &self,
        label: &str,
        width: usize,
        height: usize,
        has_holes: bool,
        texel: impl Fn(usize) -> Weighted + Send + Sync,
    ) -> GpuTexture {
        let mut texels = vec![([0.0; 4], 0.0); width * height];
        parallel::each_chunk(&mut texels, 4096, &|chunk, texels| {
            (4096 * chunk..).zip(texels).for_each(|(index, own)| *own = texel(index));
        });
        let mut levels = vec![Level { width, height, texels }];
        while let Some(last) = levels.last().filter(|last| last.width.max(last.height) > 1) {
            let next = last.coarser();
            levels.push(next);
        }
        if has_holes {
            for fine in (0..levels.len() - 1).rev() {
                let (finer, coarser) = levels.split_at_mut(fine + 1);
                finer[fine].fill_from(&coarser[0]);
            }
        }
        self.upload(label, &[levels], wgpu::TextureViewDimension::D2)
    }

    /// A texture of one texel.
    pub fn one(&self, label: &str, value: [f32; 4]) -> GpuTexture {
        self.mipped(label, 1, 1, false, |_| (value, 1.0))
    }

    /// A linear picture; numbers that are not finite are marked by alpha 0 and the colour for them, the rest has alpha 1.
    pub fn picture(&self, label: &str, image: &RgbImage) -> GpuTexture {
        let Some((image, _)) = self.within_limit(image) else { return self.one(label, [0.0; 4]) };
        let pixels = image.pixels();
        self.mipped(label, image.width(), image.height(), false, |index| {
            let rgb = pixels[index];
            if rgb.is_finite() { (rgb.extend(1.0).to_array(), 1.0) } else { (NOT_FINITE.extend(0.0).to_array(), 1.0) }
        })
    }

    /// A table without mip levels.
    pub fn table(&self, label: &str, image: &RgbImage) -> GpuTexture {
        self.upload(label, &[vec![plain(image)]], wgpu::TextureViewDimension::D2)
    }

    /// Tables of the same size as layers of one texture, without mip levels.
    pub fn layers(&self, label: &str, images: &[RgbImage]) -> GpuTexture {
        let layers: Vec<_> = images.iter().map(|image| vec![plain(image)]).collect();
        self.upload(label, &layers, wgpu::TextureViewDimension::D2Array)
    }

    /// A number a texel as (number, 1), or (0, 0) where it is NaN: filters of both, divided, leave out what is unknown.
    pub fn quantity(&self, image: &GreyImage) -> GpuTexture {
        let Some((image, _)) = self.within_limit(image) else { return self.one("stage quantity", [0.0; 4]) };
        let pixels = image.pixels();
        self.mipped("stage quantity", image.width(), image.height(), false, |index| {
            let value = pixels[index];
            (if value.is_nan() { [0.0; 4] } else { [value.clamp(-LARGEST, LARGEST), 1.0, 0.0, 0.0] }, 1.0)
        })
    }

    /// Diffuse, and specular with the roughness as fourth number; a finding when they had to be made smaller.
    pub fn materials(
        &self,
        maps: &MaterialMaps,
        covered: Option<&Image<bool>>,
    ) -> (GpuTexture, GpuTexture, Vec<Finding>) {
        let smaller =
            (self.within_limit(&maps.diffuse), self.within_limit(&maps.specular), self.within_limit(&maps.roughness));
        let (Some((diffuse, factor)), Some((specular, _)), Some((roughness, _))) = smaller else {
            return (self.one("stage diffuse", CLAY), self.one("stage specular", MATT), Vec::new());
        };
        let covered = covered.filter(|covered| {
            factor == 1 && (covered.width(), covered.height()) == (diffuse.width(), diffuse.height())
        });
        let weight = |index: usize| f32::from(u8::from(covered.is_none_or(|covered| covered.pixels()[index])));
        let finite = |value: [f32; 4]| value.map(|value: f32| if value.is_finite() { value } else { 0.0 });
        let (width, height) = (diffuse.width(), diffuse.height());
        let diffuse_texture = self.mipped("stage diffuse", width, height, covered.is_some(), |index| {
            (finite(diffuse.pixels()[index].extend(1.0).to_array()), weight(index))
        });
        let same_size = specular.pixels().len() == width * height && roughness.pixels().len() == width * height;
        let specular_texture = if same_size {
            self.mipped("stage specular", width, height, covered.is_some(), |index| {
                let texel = specular.pixels()[index].extend(roughness.pixels()[index]);
                (finite(texel.to_array()), weight(index))
            })
        } else {
            self.one("stage specular", MATT)
        };
        let mut findings = Vec::new();
        if factor > 1 {
            let message = format!(
                "the maps of {} x {} texels are shown {factor} times smaller: the graphics adapter takes {} at most",
                maps.diffuse.width(),
                maps.diffuse.height(),
                self.largest_side(),
            );
            findings.push(
                Finding::new(Severity::Note, "stage-maps-smaller", message)
                    .remedy("look at single texels on the maps panel; what is saved keeps its size"),
            );
        }
        (diffuse_texture, specular_texture, findings)
    }

    /// The image, made smaller by a whole factor where a side is beyond the limit; `None` without pixels.
    fn within_limit<'a, T: crate::image::linear::Linear>(
        &self,
        image: &'a Image<T>,
    ) -> Option<(Cow<'a, Image<T>>, usize)> {
        let side = image.width().max(image.height());
        if image.width().min(image.height()) == 0 {
            return None;
        }
        let factor = side.div_ceil(self.largest_side().max(1));
        Some((if factor == 1 { Cow::Borrowed(image) } else { Cow::Owned(resize::shrink(image, factor)) }, factor))
    }
}

/// Diffuse reflectance where there is no map.
pub(super) const CLAY: [f32; 4] = [0.5, 0.5, 0.5, 1.0];
/// Specular reflectance and roughness where there is no map.
pub(super) const MATT: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

fn plain(image: &RgbImage) -> Level {
    let texels = image.pixels().iter().map(|rgb| (rgb.extend(1.0).to_array(), 1.0)).collect();
    Level { width: image.width(), height: image.height(), texels }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coarser_levels_leave_out_texels_without_meaning_and_fill_them() {
        let texel = |value: f32, weight: f32| ([value; 4], weight);
        let texels = vec![texel(1.0, 1.0), texel(9.0, 0.0), texel(3.0, 1.0), texel(9.0, 0.0)];
        let mut fine = Level { width: 2, height: 2, texels };
        let coarse = fine.coarser();
        assert_eq!(coarse.texels, [([2.0; 4], 0.5)]);
        fine.fill_from(&coarse);
        assert_eq!(fine.texels[1].0, [2.0; 4]);
        assert_eq!(fine.texels[2].0, [3.0; 4]);
        let odd = Level { width: 3, height: 1, texels: vec![texel(1.0, 1.0); 3] };
        assert_eq!(odd.coarser().texels, [([1.0; 4], 1.0)]);
    }
}
