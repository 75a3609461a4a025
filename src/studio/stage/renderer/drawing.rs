//! What is drawn into which target.

use super::StageRenderer;
use crate::studio::copy::target;
use crate::studio::stage::pipelines::{DEPTH_FORMAT, PICTURE_FORMAT, RADIANCE_FORMAT};
use crate::studio::stage::uniforms::Sizes;
use crate::studio::stage::variants::{BehindVariant, MeshVariant, ScreenVariant};
use eframe::wgpu;

/// The targets of a size.
pub(super) struct Targets {
    sizes: Sizes,
    pub(super) radiance: wgpu::TextureView,
    pub(super) overlay: wgpu::TextureView,
    depth: wgpu::TextureView,
    /// The finished picture.
    picture: wgpu::TextureView,
    /// The same, as the window takes it.
    pub(super) copied: wgpu::BindGroup,
}

impl StageRenderer {
    /// Makes the targets anew for another size; whether it did.
    pub(super) fn follow_size(&mut self, sizes: &Sizes) -> bool {
        if self.targets.as_ref().is_some_and(|targets| targets.sizes == *sizes) {
            return false;
        }
        let target = |label, format| target(&self.maker.device, label, sizes.target, format);
        let picture = target("stage picture", PICTURE_FORMAT);
        self.targets = Some(Targets {
            sizes: *sizes,
            radiance: target("stage radiance", RADIANCE_FORMAT),
            overlay: target("stage overlay", PICTURE_FORMAT),
            depth: target("stage depth", DEPTH_FORMAT),
            copied: self.copy.of(&self.maker.device, &picture, sizes.target == sizes.screen),
            picture,
        });
        true
    }

    /// Records the scene and then the frustums over it.
    pub(super) fn draw_scene(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        mesh_variant: MeshVariant,
        behind: BehindVariant,
        coarsely: bool,
    ) {
        let (view, maps, lights) = (self.bind_view(), self.bind_maps(), self.bind_lights());
        let Some(targets) = &self.targets else { return };
        let device = &self.maker.device;
        let depth = |load| {
            Some(wgpu::RenderPassDepthStencilAttachment {
                view: &targets.depth,
                depth_ops: Some(wgpu::Operations { load, store: wgpu::StoreOp::Store }),
                stencil_ops: None,
            })
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("stage scene"),
            color_attachments: &[cleared(&targets.radiance)],
            depth_stencil_attachment: depth(wgpu::LoadOp::Clear(0.0)),
            ..Default::default()
        });
        for (index, group) in [&view, &maps, &lights].into_iter().enumerate() {
            pass.set_bind_group(index as u32, group, &[]);
        }
        pass.set_pipeline(self.pipelines.behind(device, behind));
        pass.draw(0..3, 0..1);
        if let Some(mesh) = self.mesh.shown()
            && let Some((corners, all)) = &mesh.buffers
        {
            let (indices, count) = mesh.coarse.as_ref().filter(|_| coarsely).unwrap_or(all);
            pass.set_pipeline(self.pipelines.mesh(device, mesh_variant));
            pass.set_vertex_buffer(0, corners.slice(..));
            pass.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..*count, 0, 0..1);
        }
        drop(pass);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("stage frustums"),
            color_attachments: &[cleared(&targets.overlay)],
            depth_stencil_attachment: depth(wgpu::LoadOp::Load),
            ..Default::default()
        });
        pass.set_bind_group(0, &view, &[]);
        self.overlay.draw(&mut pass, &self.pipelines);
    }

    /// Records how the drawn scene becomes a picture.
    pub(super) fn make_picture(&mut self, encoder: &mut wgpu::CommandEncoder, variant: ScreenVariant) {
        let group = self.bind_screen();
        let (Some(targets), Some(group)) = (&self.targets, group) else { return };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("stage picture"),
            color_attachments: &[cleared(&targets.picture)],
            ..Default::default()
        });
        pass.set_pipeline(self.pipelines.screen(&self.maker.device, variant));
        pass.set_bind_group(0, &group, &[]);
        pass.draw(0..3, 0..1);
    }
}

fn cleared(view: &wgpu::TextureView) -> Option<wgpu::RenderPassColorAttachment<'_>> {
    Some(wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store: wgpu::StoreOp::Store },
    })
}
