//! The stage: the mesh in 3-D, drawn by wgpu inside a rectangle of the window.
//!
//! Read [`content`] first: a [`StageFrame`] says where one looks from ([`eye`]), what is shown and how. It is handed to
//! [`Stage::show`] each frame; the stage keeps nothing but what it uploaded, and knows nothing of the app around it.
//!
//! | file | what it holds |
//! |---|---|
//! | [`eye`], [`orbit`] | orbit and photo cameras, their matrix, rays and projection |
//! | [`navigate`](mod@navigate) | drags and wheel as movements of the eye |
//! | [`content`] | what is shown and how |
//! | [`frustum`] | cameras as pyramids, and picking them |
//! | `light` | a light blurred for quick shading, and what that leaves out |
//! | `texels`, `mesh`, `slot` | uploads, on another thread where they are large |
//! | `coarse` | fewer triangles while a large mesh is turned on a slow adapter |
//! | `pipelines`, `variants`, `uniforms`, `shader/` | the fixed part of the drawing, what it is made for, and what it is told |
//! | `overlay`, `renderer` | the part that changes, and when the scene is drawn anew |
//!
//! The scene is drawn into an own target of linear radiance in half precision; the display transform of
//! [`crate::image::display`] makes a picture of that target, which is kept. So exposure and curve cost one triangle, a
//! frame in which nothing changed a copy, and numbers beyond 65504, the largest of half precision, are cut (a sun is still
//! blurred by its full strength).
//!
//! What it refuses to do: shadows and interreflection (the path tracer makes such a picture, see
//! [`StageContent::traced`]), picking on the surface ([`crate::trace::Bvh`] does), reading the mouse for anything but
//! the eye, and panicking: content that cannot be shown is told by [`StageStatus::findings`].

mod coarse;
pub mod content;
pub mod eye;
pub mod frustum;
mod light;
mod mesh;
pub mod navigate;
pub mod orbit;
mod overlay;
mod pipelines;
mod renderer;
mod slot;
mod texels;
mod uniforms;
mod variants;

pub use content::{
    Backdrop, CoveredTexels, Layer, PhotoMode, StageCamera, StageContent, StageFrame, StageLight, StageLook,
    StageQuantity,
};
pub use frustum::{frustum_depth, pick_camera};
pub use navigate::{Navigation, navigate};
pub use renderer::StageStatus;

use eframe::{egui, egui_wgpu, wgpu};
use renderer::StageRenderer;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A stage; each is a picture of its own. Cloning gives another handle of the same one.
#[derive(Clone)]
pub struct Stage {
    renderer: Arc<Mutex<StageRenderer>>,
}

impl Stage {
    /// A stage on the adapter of a window. The window's pass must have one sample a pixel and no depth, as eframe's has
    /// unless told otherwise.
    pub fn new(window: &egui_wgpu::RenderState) -> Self {
        let renderer = StageRenderer::new(&window.device, &window.queue, window.target_format);
        Stage { renderer: Arc::new(Mutex::new(renderer)) }
    }

    /// Shows a frame in all the room there is. The response knows clicks, drags and the pointer; what they mean is up to
    /// the caller ([`navigate()`] for the eye).
    pub fn show(&self, ui: &mut egui::Ui, frame: &StageFrame) -> egui::Response {
        let size = ui.available_size().max(egui::Vec2::ZERO);
        let (rect, response) = ui.allocate_exact_size(size, egui::Sense::click_and_drag());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Scene in 3-D"));
        if ui.is_rect_visible(rect) && rect.is_positive() {
            let painting =
                Painting { renderer: self.renderer.clone(), frame: frame.clone(), rect, context: ui.ctx().clone() };
            crate::studio::repaint::tell_opaque(ui.ctx(), rect);
            ui.painter().add(egui_wgpu::Callback::new_paint_callback(rect, painting));
        }
        response
    }

    /// What it did so far.
    pub fn status(&self) -> StageStatus {
        lock(&self.renderer).status().clone()
    }
}

/// A renderer is never half changed in a way that matters: after a panic in it, it is drawn with as it is.
fn lock(renderer: &Mutex<StageRenderer>) -> MutexGuard<'_, StageRenderer> {
    renderer.lock().unwrap_or_else(PoisonError::into_inner)
}

/// One frame on its way to the window.
struct Painting {
    renderer: Arc<Mutex<StageRenderer>>,
    frame: StageFrame,
    rect: egui::Rect,
    context: egui::Context,
}

impl egui_wgpu::CallbackTrait for Painting {
    fn prepare(
        &self,
        _device: &wgpu::Device,
        _queue: &wgpu::Queue,
        screen: &egui_wgpu::ScreenDescriptor,
        encoder: &mut wgpu::CommandEncoder,
        _resources: &mut egui_wgpu::CallbackResources,
    ) -> Vec<wgpu::CommandBuffer> {
        // The size that the window's pass will set for this rectangle.
        let info = egui::PaintCallbackInfo {
            viewport: self.rect,
            clip_rect: self.rect,
            pixels_per_point: screen.pixels_per_point,
            screen_size_px: screen.size_in_pixels,
        };
        let viewport = info.viewport_in_pixels();
        let size = [viewport.width_px, viewport.height_px].map(|side| u32::try_from(side).unwrap_or(0));
        lock(&self.renderer).prepare(&self.frame, size, screen.pixels_per_point, &self.context, encoder);
        Vec::new()
    }

    fn paint(
        &self,
        _info: egui::PaintCallbackInfo,
        pass: &mut wgpu::RenderPass<'static>,
        _resources: &egui_wgpu::CallbackResources,
    ) {
        lock(&self.renderer).paint(pass);
    }
}
