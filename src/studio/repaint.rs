//! Only what changed of the window is drawn, where a processor draws.
//!
//! egui draws a whole window with every frame, which is most of what a frame costs a processor. Here the window's picture
//! is kept: what egui wants drawn is compared with what it wanted last, rectangles in which something differs are drawn
//! anew, and the window is handed a copy of the picture. egui does not notice: its shapes are taken as they leave it, and
//! one that paints the picture is put in their place.
//!
//! A pixel outside those rectangles is touched by the same shapes in the same order as before, so it has the colour that
//! it would be drawn with ([`changes`]).

mod changes;
#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

use super::copy::{Copy, target};
use changes::{Drawn, PixelRect};
use eframe::{egui, egui_wgpu, wgpu};
use egui::epaint::textures::TexturesDelta;
use egui::epaint::{ClippedPrimitive, ClippedShape, Primitive};
use egui::{Color32, Context, FullOutput, Id, Mesh, Rect, Shape, TextureId};
use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Where a frame tells which of its callbacks hides what is behind it.
fn opaque_key() -> Id {
    Id::unique("callback that hides what is behind it")
}

/// Tells that a callback of this frame paints every pixel of this rectangle: what is behind it need not be drawn.
pub(super) fn tell_opaque(context: &Context, rect: Rect) {
    context.data_mut(|data| data.insert_temp(opaque_key(), Some(rect)));
}

fn lost_key() -> Id {
    Id::unique("the last frame was lost")
}

/// Whether what was recorded for the last frame never reached the adapter, as where the window had another size by then.
pub(super) fn was_lost(context: &Context) -> bool {
    context.data(|data| data.get_temp(lost_key()).unwrap_or(false))
}

/// What takes egui's shapes and puts the kept picture in their place.
pub(super) struct Repaint {
    canvas: Arc<Mutex<Canvas>>,
}

impl Repaint {
    /// For a window of this format, whose pass has one sample a pixel and no depth.
    pub fn new(window_format: wgpu::TextureFormat) -> Self {
        Repaint { canvas: Arc::new(Mutex::new(Canvas::new(window_format))) }
    }
}

impl egui::Plugin for Repaint {
    fn debug_name(&self) -> &'static str {
        "repaint"
    }

    fn output_hook(&mut self, context: &Context, output: &mut FullOutput) {
        lock(&self.canvas).textures.append(std::mem::take(&mut output.textures_delta));
        let painting = Painting {
            canvas: Arc::clone(&self.canvas),
            shapes: std::mem::take(&mut output.shapes),
            opaque: context.data_mut(|data| data.remove_temp(opaque_key()).flatten()),
            background: context.global_style().visuals.panel_fill.to_opaque(),
            context: context.clone(),
        };
        let callback = egui_wgpu::Callback::new_paint_callback(context.viewport_rect(), painting);
        output.shapes = vec![ClippedShape::new(Rect::EVERYTHING, Shape::Callback(callback))];
    }
}

/// A picture is never half drawn in a way that matters: after a panic it is drawn on as it is.
fn lock(canvas: &Mutex<Canvas>) -> MutexGuard<'_, Canvas> {
    canvas.lock().unwrap_or_else(PoisonError::into_inner)
}

/// One frame on its way to the window.
struct Painting {
    canvas: Arc<Mutex<Canvas>>,
    shapes: Vec<ClippedShape>,
    opaque: Option<Rect>,
    background: Color32,
    context: Context,
}

impl egui_wgpu::CallbackTrait for Painting {
    fn prepare(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        screen: &egui_wgpu::ScreenDescriptor,
        encoder: &mut wgpu::CommandEncoder,
        _resources: &mut egui_wgpu::CallbackResources,
    ) -> Vec<wgpu::CommandBuffer> {
        let wanted = self.context.tessellate(self.shapes.clone(), screen.pixels_per_point);
        let mut canvas = lock(&self.canvas);
        let was_lost = std::mem::replace(&mut canvas.is_on_its_way, true);
        if was_lost {
            canvas.picture = None;
        }
        self.context.data_mut(|data| data.insert_temp(lost_key(), was_lost));
        let commands = canvas.follow((device, queue), screen, encoder, &wanted, self.opaque, self.background);
        self.context.data_mut(|data| data.insert_temp(lost_key(), false));
        commands
    }

    fn paint(
        &self,
        info: egui::PaintCallbackInfo,
        pass: &mut wgpu::RenderPass<'static>,
        _resources: &egui_wgpu::CallbackResources,
    ) {
        let [width, height] = info.screen_size_px;
        pass.set_viewport(0.0, 0.0, width as f32, height as f32, 0.0, 1.0);
        lock(&self.canvas).show(pass);
    }
}

/// The picture of a window of one size.
struct Picture {
    size: [u32; 2],
    pixels_per_point: f32,
    view: wgpu::TextureView,
    copied: wgpu::BindGroup,
}

/// What draws, and what it drew.
struct Canvas {
    window_format: wgpu::TextureFormat,
    tools: Option<(egui_wgpu::Renderer, Copy)>,
    picture: Option<Picture>,
    /// Not yet on the adapter.
    textures: TexturesDelta,
    /// Counts how often all of a texture was replaced.
    versions: HashMap<TextureId, u64>,
    /// Textures that the last frame drew for the last time.
    last_drawn: Vec<TextureId>,
    drawn: Vec<Drawn>,
    /// A frame was recorded, and the window's pass, which comes after it, was not yet.
    is_on_its_way: bool,
}

impl Drop for Canvas {
    fn drop(&mut self) {
        self.textures.clear();
    }
}

impl Canvas {
    fn new(window_format: wgpu::TextureFormat) -> Self {
        Canvas {
            window_format,
            tools: None,
            picture: None,
            textures: TexturesDelta::default(),
            versions: HashMap::new(),
            last_drawn: Vec::new(),
            drawn: Vec::new(),
            is_on_its_way: false,
        }
    }

    /// Records what has to be drawn for the picture to be that of `wanted`.
    fn follow(
        &mut self,
        (device, queue): (&wgpu::Device, &wgpu::Queue),
        screen: &egui_wgpu::ScreenDescriptor,
        encoder: &mut wgpu::CommandEncoder,
        wanted: &[ClippedPrimitive],
        opaque: Option<Rect>,
        background: Color32,
    ) -> Vec<wgpu::CommandBuffer> {
        self.take_up_textures(device, queue);
        self.take_up_size(device, screen);
        let now: Vec<Drawn> = wanted.iter().map(|primitive| self.drawn_of(primitive, screen)).collect();
        let mut parts = Vec::new();
        for part in changes::between(&self.drawn, &now) {
            let clip = part.in_points(screen.pixels_per_point);
            // What a callback hides need not be drawn.
            let hides = |(primitive, drawn): (&ClippedPrimitive, &Drawn)| match &primitive.primitive {
                Primitive::Callback(callback) => Some(callback.rect) == opaque && drawn.bounds.contains(&part),
                Primitive::Mesh(_) => false,
            };
            let first = wanted.iter().zip(&now).rposition(hides);
            if first.is_none() {
                let mut mesh = Mesh::default();
                mesh.add_colored_rect(clip, background);
                parts.push(ClippedPrimitive { clip_rect: clip, primitive: Primitive::Mesh(mesh) });
            }
            let from = first.unwrap_or(0);
            let touched = wanted[from..].iter().zip(&now[from..]).filter(|(_, drawn)| drawn.bounds.overlaps(&part));
            parts.extend(touched.map(|(primitive, _)| ClippedPrimitive {
                clip_rect: primitive.clip_rect.intersect(clip),
                primitive: primitive.primitive.clone(),
            }));
        }
        self.drawn = now;
        let (Some((renderer, _)), Some(picture)) = (&mut self.tools, &self.picture) else { return Vec::new() };
        let commands = renderer.update_buffers(device, queue, encoder, &parts, screen);
        if !parts.is_empty() {
            let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("repaint"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &picture.view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
                })],
                ..Default::default()
            });
            renderer.render(&mut pass.forget_lifetime(), &parts, screen);
        }
        commands
    }

    /// Copies the picture into the window.
    fn show(&mut self, pass: &mut wgpu::RenderPass<'_>) {
        self.is_on_its_way = false;
        if let (Some((_, copy)), Some(picture)) = (&self.tools, &self.picture) {
            copy.draw(pass, &picture.copied);
        }
    }

    /// Brings textures to the adapter, and frees those that were drawn for the last time with the frame before.
    fn take_up_textures(&mut self, device: &wgpu::Device, queue: &wgpu::Queue) {
        let (renderer, _) = self.tools.get_or_insert_with(|| {
            let options = egui_wgpu::RendererOptions {
                msaa_samples: 1,
                depth_stencil_format: None,
                dithering: false,
                predictable_texture_filtering: false,
            };
            let renderer = egui_wgpu::Renderer::new(device, self.window_format, options);
            (renderer, Copy::new(device, self.window_format))
        });
        for id in std::mem::take(&mut self.last_drawn) {
            renderer.free_texture(&id);
            self.versions.remove(&id);
        }
        for (id, deltas) in self.textures.set.drain() {
            for delta in deltas {
                // A part of egui's own texture is a new letter, beside those that are there.
                if delta.is_whole() || id != TextureId::default() {
                    *self.versions.entry(id).or_default() += 1;
                }
                renderer.update_texture(device, queue, id, &delta);
            }
        }
        self.last_drawn = self.textures.free.drain().collect();
    }

    /// Begins a new picture where the window has another size.
    fn take_up_size(&mut self, device: &wgpu::Device, screen: &egui_wgpu::ScreenDescriptor) {
        let (size, scale) = (screen.size_in_pixels, screen.pixels_per_point);
        let is_same = |picture: &Picture| picture.size == size && picture.pixels_per_point == scale;
        let Some((_, copy)) = self.tools.as_ref().filter(|_| !self.picture.as_ref().is_some_and(is_same)) else {
            return;
        };
        let view = target(device, "repaint", size, self.window_format);
        let copied = copy.of(device, &view, true);
        self.picture = Some(Picture { size, pixels_per_point: scale, view, copied });
        // Nothing of it is drawn yet, be it the background alone.
        self.drawn = vec![Drawn { identity: None, bounds: PixelRect::of_size(size) }];
    }

    fn drawn_of(&self, primitive: &ClippedPrimitive, screen: &egui_wgpu::ScreenDescriptor) -> Drawn {
        let (scale, size) = (screen.pixels_per_point, screen.size_in_pixels);
        let (bounds, identity) = match &primitive.primitive {
            // What it paints, it alone knows; nothing beyond its pixels.
            Primitive::Callback(callback) => {
                (PixelRect::exactly(callback.rect.intersect(primitive.clip_rect), scale, size), None)
            }
            Primitive::Mesh(mesh) => {
                let mut hasher = DefaultHasher::new();
                let clip = primitive.clip_rect;
                for number in [clip.min.x, clip.min.y, clip.max.x, clip.max.y] {
                    hasher.write_u32(number.to_bits());
                }
                (mesh.texture_id, self.versions.get(&mesh.texture_id)).hash(&mut hasher);
                hasher.write(bytemuck::cast_slice(&mesh.indices));
                for vertex in &mesh.vertices {
                    let place = [vertex.pos.x, vertex.pos.y, vertex.uv.x, vertex.uv.y].map(f32::to_bits);
                    hasher.write(bytemuck::bytes_of(&place));
                    hasher.write(&vertex.color.to_array());
                }
                let rect = mesh.calc_bounds().intersect(primitive.clip_rect);
                (PixelRect::around(rect, scale, size), Some(hasher.finish()))
            }
        };
        Drawn { identity, bounds }
    }
}
