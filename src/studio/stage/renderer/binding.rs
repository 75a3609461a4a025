//! What the shaders of the stage are given: maps, lights, and the pictures that are shown over the scene.

use super::StageRenderer;
use crate::image::RgbImage;
use crate::studio::stage::pipelines::bind;
use crate::studio::stage::slot::Slot;
use crate::studio::stage::texels::GpuTexture;
use eframe::wgpu;
use std::sync::Arc;

impl StageRenderer {
    pub(super) fn bind_view(&self) -> wgpu::BindGroup {
        bind(&self.maker.device, &self.pipelines.view_layout, &[self.view_buffer.as_entire_binding()])
    }

    pub(super) fn bind_maps(&self) -> wgpu::BindGroup {
        use wgpu::BindingResource::{Sampler, TextureView};
        let (diffuse, specular) =
            self.maps.shown().map_or((&self.missing.diffuse, &self.missing.specular), |maps| (&maps.0, &maps.1));
        let quantity = self.quantity.shown().or_else(|| self.photos.shown()).unwrap_or(&self.missing.black);
        let resources = [
            Sampler(&self.pipelines.map_sampler),
            TextureView(&diffuse.view),
            TextureView(&specular.view),
            TextureView(&quantity.view),
        ];
        bind(&self.maker.device, &self.pipelines.map_layout, &resources)
    }

    pub(super) fn bind_lights(&self) -> wgpu::BindGroup {
        use wgpu::BindingResource::{Sampler, TextureView};
        let [light, other] = self.lights.each_ref().map(|slot| slot.shown().unwrap_or(&self.missing.light));
        let resources = [
            Sampler(&self.pipelines.light_sampler),
            TextureView(&light.map.view),
            TextureView(&light.layers.view),
            TextureView(&other.map.view),
            TextureView(&other.layers.view),
            TextureView(&light.reflectances.view),
        ];
        bind(&self.maker.device, &self.pipelines.light_layout, &resources)
    }

    pub(super) fn bind_screen(&self) -> Option<wgpu::BindGroup> {
        use wgpu::BindingResource::{Sampler, TextureView};
        let targets = self.targets.as_ref()?;
        let or_black =
            |slot: &'_ Slot<Arc<RgbImage>, GpuTexture>| slot.shown().unwrap_or(&self.missing.black).view.clone();
        let (photo, traced) = (or_black(&self.photo), or_black(&self.traced));
        let resources = [
            self.screen_buffer.as_entire_binding(),
            Sampler(&self.pipelines.map_sampler),
            TextureView(&targets.radiance),
            TextureView(&targets.overlay),
            TextureView(&photo),
            TextureView(&traced),
        ];
        Some(bind(&self.maker.device, &self.pipelines.screen_layout, &resources))
    }
}
