//! A finished picture into the window's pass: one triangle and one texel a pixel.

use eframe::wgpu;

/// A picture that is drawn into and read.
pub(super) fn target(
    device: &wgpu::Device,
    label: &str,
    [width, height]: [u32; 2],
    format: wgpu::TextureFormat,
) -> wgpu::TextureView {
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// What copies pictures into a window.
pub(super) struct Copy {
    pipeline: wgpu::RenderPipeline,
    /// For a picture of the size it is shown at.
    exact: wgpu::Sampler,
    /// For one of another size.
    smooth: wgpu::Sampler,
}

impl Copy {
    /// What copies into a window of this format.
    pub fn new(device: &wgpu::Device, window_format: wgpu::TextureFormat) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("copy"),
            source: wgpu::ShaderSource::Wgsl(include_str!("copy.wgsl").into()),
        });
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("copy"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("corner"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("colour"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(window_format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let sampler = |filter| {
            device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("copy"),
                mag_filter: filter,
                min_filter: filter,
                ..Default::default()
            })
        };
        Copy { pipeline, exact: sampler(wgpu::FilterMode::Nearest), smooth: sampler(wgpu::FilterMode::Linear) }
    }

    /// What a picture is copied by. `is_exact` where it has the size that it is shown at.
    pub fn of(&self, device: &wgpu::Device, picture: &wgpu::TextureView, is_exact: bool) -> wgpu::BindGroup {
        let sampler = if is_exact { &self.exact } else { &self.smooth };
        let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("copy"),
            layout: &self.pipeline.get_bind_group_layout(0),
            entries: &[
                entry(0, wgpu::BindingResource::Sampler(sampler)),
                entry(1, wgpu::BindingResource::TextureView(picture)),
            ],
        })
    }

    /// Copies into the whole viewport of a pass.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, picture: &wgpu::BindGroup) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, picture, &[]);
        pass.draw(0..3, 0..1);
    }
}
