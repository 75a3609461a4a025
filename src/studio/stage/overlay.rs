//! Frustums on the graphics adapter: their lines, and their thumbnails in one texture of tiles.

use super::content::StageCamera;
use super::frustum::{self, Line, PictureCorner};
use super::pipelines::{Pipelines, bind};
use crate::image::display::DisplaySettings;
use crate::image::{RgbImage, resize};
use eframe::egui::Color32;
use eframe::wgpu;
use glam::{Vec2, Vec3};
use std::sync::Arc;

/// Side of a thumbnail's tile in texels. Photos are squeezed into it and stretched again by their frustum.
const TILE: u32 = 64;
/// Levels of a tile, each half the last: frustums are mostly small on the screen.
const LEVELS: u32 = 4;

/// What the lines and corners were made from.
type Key = (Arc<Vec<StageCamera>>, f32, Vec3, Color32);

/// The frustums as buffers.
#[derive(Default)]
pub(super) struct Overlay {
    key: Option<Key>,
    lines: Option<(wgpu::Buffer, u32)>,
    corners: Option<(wgpu::Buffer, u32)>,
    atlas: Option<Atlas>,
}

/// Thumbnails as tiles of one texture.
struct Atlas {
    texture: wgpu::Texture,
    group: wgpu::BindGroup,
    /// Tiles along each side.
    side: u32,
    /// Whose photo each tile holds.
    tiles: Vec<Option<Arc<RgbImage>>>,
}

impl Overlay {
    /// Follows the cameras; whether anything changed.
    pub fn follow(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        pipelines: &Pipelines,
        (cameras, depth, eye, accent): (&Arc<Vec<StageCamera>>, f32, Vec3, Color32),
    ) -> bool {
        let same = self.key.as_ref().is_some_and(|key| {
            Arc::ptr_eq(&key.0, cameras) && key.1 == depth && (key.2 == eye || cameras.is_empty()) && key.3 == accent
        });
        if same {
            return false;
        }
        self.key = Some((cameras.clone(), depth, eye, accent));
        self.follow_thumbnails(device, queue, pipelines, cameras);
        let lines = frustum::lines(cameras, depth, eye, accent);
        let side = self.atlas.as_ref().map_or(1, |atlas| atlas.side);
        let held = side as usize * side as usize;
        // Half a texel is left out at each border, where the filter would reach the next tile.
        let tile = |index: usize| {
            let corner = Vec2::new((index as u32 % side) as f32, (index as u32 / side) as f32);
            let inset = Vec2::splat(0.5 / TILE as f32);
            ((corner + inset) / side as f32, (corner + Vec2::ONE - inset) / side as f32)
        };
        let shown = &cameras[..cameras.len().min(held)];
        let corners = if self.atlas.is_some() { frustum::pictures(shown, depth, eye, tile) } else { Vec::new() };
        self.lines = buffer::<Line>(device, queue, "stage lines", &lines);
        self.corners = buffer::<PictureCorner>(device, queue, "stage thumbnails", &corners);
        true
    }

    fn follow_thumbnails(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        pipelines: &Pipelines,
        cameras: &[StageCamera],
    ) {
        if cameras.iter().all(|camera| camera.thumbnail.is_none()) {
            self.atlas = None;
            return;
        }
        let most = (device.limits().max_texture_dimension_2d / TILE).max(1);
        let side = ((cameras.len() as f64).sqrt().ceil() as u32).clamp(1, most);
        if self.atlas.as_ref().is_none_or(|atlas| atlas.side != side) {
            self.atlas = Some(Atlas::new(device, pipelines, side));
        }
        let Some(atlas) = &mut self.atlas else { return };
        for (index, (camera, tile)) in cameras.iter().zip(&mut atlas.tiles).enumerate() {
            let Some(photo) = &camera.thumbnail else { continue };
            if tile.as_ref().is_some_and(|shown| Arc::ptr_eq(shown, photo)) {
                continue;
            }
            *tile = Some(photo.clone());
            let photo = squeezed(photo);
            for level in 0..LEVELS {
                let length = TILE >> level;
                queue.write_texture(
                    wgpu::TexelCopyTextureInfo {
                        texture: &atlas.texture,
                        mip_level: level,
                        origin: wgpu::Origin3d {
                            x: index as u32 % side * length,
                            y: index as u32 / side * length,
                            z: 0,
                        },
                        aspect: wgpu::TextureAspect::All,
                    },
                    &bytes(&resize::shrink(&photo, 1 << level)),
                    wgpu::TexelCopyBufferLayout {
                        offset: 0,
                        bytes_per_row: Some(4 * length),
                        rows_per_image: Some(length),
                    },
                    wgpu::Extent3d { width: length, height: length, depth_or_array_layers: 1 },
                );
            }
        }
    }

    /// Draws thumbnails, then lines, into a pass whose group 0 is the view.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, pipelines: &Pipelines) {
        if let (Some((buffer, count)), Some(atlas)) = (&self.corners, &self.atlas) {
            pass.set_pipeline(&pipelines.pictures);
            pass.set_bind_group(1, &atlas.group, &[]);
            pass.set_vertex_buffer(0, buffer.slice(..));
            pass.draw(0..*count, 0..1);
        }
        if let Some((buffer, count)) = &self.lines {
            pass.set_pipeline(&pipelines.lines);
            pass.set_vertex_buffer(0, buffer.slice(..));
            pass.draw(0..6, 0..*count);
        }
    }
}

impl Atlas {
    fn new(device: &wgpu::Device, pipelines: &Pipelines, side: u32) -> Self {
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("stage thumbnails"),
            size: wgpu::Extent3d { width: side * TILE, height: side * TILE, depth_or_array_layers: 1 },
            mip_level_count: LEVELS,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let resources =
            [wgpu::BindingResource::Sampler(&pipelines.map_sampler), wgpu::BindingResource::TextureView(&view)];
        let group = bind(device, &pipelines.picture_layout, &resources);
        Atlas { texture, group, side, tiles: vec![None; side as usize * side as usize] }
    }
}

/// A buffer of vertices and their number; `None` without any, or where they do not fit.
fn buffer<T: bytemuck::NoUninit>(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    label: &str,
    values: &[T],
) -> Option<(wgpu::Buffer, u32)> {
    let bytes: &[u8] = bytemuck::cast_slice(values);
    if bytes.is_empty() || bytes.len() as u64 > device.limits().max_buffer_size {
        return None;
    }
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: bytes.len() as u64,
        usage: wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    queue.write_buffer(&buffer, 0, bytes);
    Some((buffer, values.len() as u32))
}

/// A photo squeezed into a tile: means of blocks first, so that nothing is skipped, then linear.
fn squeezed(photo: &RgbImage) -> RgbImage {
    let side = TILE as usize;
    let factor = (photo.width().min(photo.height()) / side).max(1);
    resize::enlarge(&resize::shrink(photo, factor), side, side)
}

/// sRGB bytes with an opacity of 1.
fn bytes(picture: &RgbImage) -> Vec<u8> {
    let display = DisplaySettings::default();
    let texel = |rgb: &Vec3| {
        let [r, g, b] = display.bytes(*rgb, 0, 0);
        [r, g, b, 255]
    };
    picture.pixels().iter().flat_map(texel).collect()
}
