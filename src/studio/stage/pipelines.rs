//! The fixed part of the drawing: shaders, their bindings, and the state they are drawn with.
//!
//! Only what a downlevel adapter has: no storage buffers, no features, at most five textures a stage of the pipeline.

use super::frustum::{Line, PictureCorner};
use super::light::{FIRST_WIDTH, OUT_OF_FOCUS, WIDTHS};
use super::uniforms::{ScreenUniform, ViewUniform};
use super::variants::{BehindVariant, Constants, MeshVariant, ScreenVariant};
use crate::image::display::{SCALE, STRIPE_PIXELS, TOO_BRIGHT, TOO_DARK};
use eframe::wgpu;
use glam::Vec3;
use std::collections::HashMap;
use std::fmt::Write;

/// Format of the target of radiance.
pub(super) const RADIANCE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
/// Format of the finished picture, and of the target of frustums: sRGB as stored, there times opacity.
pub(super) const PICTURE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// Format of the depth of both.
pub(super) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Depth is larger where it is nearer.
const NEARER: wgpu::CompareFunction = wgpu::CompareFunction::GreaterEqual;

/// A corner of the mesh, as the shader takes it.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct MeshCorner {
    /// Place in the world.
    pub position: [f32; 3],
    /// Shading normal.
    pub normal: [f32; 3],
    /// Texture coordinate, v up.
    pub uv: [f32; 2],
    /// Linear colour times its weight, and the weight, in half precision.
    pub colour: [half::f16; 4],
}

/// Everything that is made once.
pub(super) struct Pipelines {
    surface: wgpu::ShaderModule,
    display: wgpu::ShaderModule,
    meshes: HashMap<MeshVariant, wgpu::RenderPipeline>,
    behinds: HashMap<BehindVariant, wgpu::RenderPipeline>,
    screens: HashMap<ScreenVariant, wgpu::RenderPipeline>,
    pub lines: wgpu::RenderPipeline,
    pub pictures: wgpu::RenderPipeline,
    pub view_layout: wgpu::BindGroupLayout,
    pub map_layout: wgpu::BindGroupLayout,
    pub light_layout: wgpu::BindGroupLayout,
    pub picture_layout: wgpu::BindGroupLayout,
    pub screen_layout: wgpu::BindGroupLayout,
    /// Linear within and between levels, clamped.
    pub map_sampler: wgpu::Sampler,
    /// Linear, wraps around the horizon.
    pub light_sampler: wgpu::Sampler,
}

/// The constants of Rust that the shaders repeat.
fn constants() -> String {
    let vec3 = |rgb: Vec3| format!("vec3<f32>({:?}, {:?}, {:?})", rgb.x, rgb.y, rgb.z);
    let scale: Vec<String> = SCALE.iter().map(|&rgb| vec3(rgb)).collect();
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(text, "const SCALE_LENGTH: i32 = {};", SCALE.len());
    let _ = writeln!(text, "const SCALE = array<vec3<f32>, {}>({});", SCALE.len(), scale.join(", "));
    let _ = writeln!(text, "const TOO_BRIGHT = {};\nconst TOO_DARK = {};", vec3(TOO_BRIGHT), vec3(TOO_DARK));
    let _ = writeln!(text, "const UNKNOWN = vec3<f32>(0.4);\nconst STRIPE_PIXELS: u32 = {STRIPE_PIXELS}u;");
    let _ = writeln!(text, "const FIRST_WIDTH: f32 = {FIRST_WIDTH:?};\nconst WIDTHS: i32 = {WIDTHS};");
    let _ = writeln!(text, "const OUT_OF_FOCUS: i32 = {OUT_OF_FOCUS};");
    text
}

fn shader(device: &wgpu::Device, label: &str, parts: &[&str]) -> wgpu::ShaderModule {
    device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(label),
        source: wgpu::ShaderSource::Wgsl(parts.concat().into()),
    })
}

/// What a binding of a layout is.
enum Binding {
    Uniform(u64),
    Sampler,
    Texture,
    TextureLayers,
}

fn layout(device: &wgpu::Device, label: &str, bindings: &[Binding]) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = bindings
        .iter()
        .zip(0..)
        .map(|(binding, index)| {
            let texture = |view_dimension| wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Float { filterable: true },
                view_dimension,
                multisampled: false,
            };
            wgpu::BindGroupLayoutEntry {
                binding: index,
                visibility: match binding {
                    Binding::Uniform(_) => wgpu::ShaderStages::VERTEX_FRAGMENT,
                    _ => wgpu::ShaderStages::FRAGMENT,
                },
                ty: match binding {
                    Binding::Uniform(size) => wgpu::BindingType::Buffer {
                        ty: wgpu::BufferBindingType::Uniform,
                        has_dynamic_offset: false,
                        min_binding_size: std::num::NonZeroU64::new(*size),
                    },
                    Binding::Sampler => wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
                    Binding::Texture => texture(wgpu::TextureViewDimension::D2),
                    Binding::TextureLayers => texture(wgpu::TextureViewDimension::D2Array),
                },
                count: None,
            }
        })
        .collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

/// A bind group of resources in the order of its layout.
pub(super) fn bind(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    resources: &[wgpu::BindingResource<'_>],
) -> wgpu::BindGroup {
    let entries: Vec<_> = resources
        .iter()
        .zip(0..)
        .map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("stage"), layout, entries: &entries })
}

/// What distinguishes one pipeline from another.
struct Recipe<'a> {
    label: &'a str,
    module: &'a wgpu::ShaderModule,
    entries: (&'a str, &'a str),
    layouts: &'a [Option<&'a wgpu::BindGroupLayout>],
    buffer: Option<wgpu::VertexBufferLayout<'a>>,
    format: wgpu::TextureFormat,
    blend: Option<wgpu::BlendState>,
    /// Whether depth is written, and how it is compared; `None` without depth.
    depth: Option<(bool, wgpu::CompareFunction)>,
    /// Of the colours.
    constants: Constants,
}

fn pipeline(device: &wgpu::Device, recipe: Recipe<'_>) -> wgpu::RenderPipeline {
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(recipe.label),
        bind_group_layouts: recipe.layouts,
        immediate_size: 0,
    });
    let buffers: Vec<_> = recipe.buffer.into_iter().map(Some).collect();
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(recipe.label),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: recipe.module,
            entry_point: Some(recipe.entries.0),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &buffers,
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: recipe.depth.map(|(write, compare)| wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(write),
            depth_compare: Some(compare),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: recipe.module,
            entry_point: Some(recipe.entries.1),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &recipe.constants,
                ..Default::default()
            },
            targets: &[Some(wgpu::ColorTargetState {
                format: recipe.format,
                blend: recipe.blend,
                write_mask: wgpu::ColorWrites::ALL,
            })],
        }),
        multiview_mask: None,
        cache: None,
    })
}

impl Pipelines {
    /// Those that every frame needs; the others are made when they are first drawn with.
    pub fn new(device: &wgpu::Device) -> Self {
        use Binding::{Sampler, Texture, TextureLayers, Uniform};
        let constants = constants();
        let colour = include_str!("shader/colour.wgsl");
        let view = include_str!("shader/view.wgsl");
        let surface = shader(device, "stage surface", &[&constants, colour, view, include_str!("shader/surface.wgsl")]);
        let overlay = shader(device, "stage overlay", &[view, include_str!("shader/overlay.wgsl")]);
        let display = shader(device, "stage display", &[&constants, colour, include_str!("shader/display.wgsl")]);

        let view_layout = layout(device, "stage view", &[Uniform(size_of::<ViewUniform>() as u64)]);
        let map_layout = layout(device, "stage maps", &[Sampler, Texture, Texture, Texture]);
        let light_layout =
            layout(device, "stage lights", &[Sampler, Texture, TextureLayers, Texture, TextureLayers, Texture]);
        let picture_layout = layout(device, "stage thumbnails", &[Sampler, Texture]);
        let screen_layout = layout(
            device,
            "stage screen",
            &[Uniform(size_of::<ScreenUniform>() as u64), Sampler, Texture, Texture, Texture, Texture],
        );

        let lines = pipeline(
            device,
            Recipe {
                label: "stage lines",
                module: &overlay,
                entries: ("corner_of_line", "colour_of_line"),
                layouts: &[Some(&view_layout)],
                buffer: Some(wgpu::VertexBufferLayout {
                    array_stride: size_of::<Line>() as u64,
                    step_mode: wgpu::VertexStepMode::Instance,
                    attributes: &wgpu::vertex_attr_array![0 => Float32x4, 1 => Float32x4, 2 => Float32x4],
                }),
                format: PICTURE_FORMAT,
                blend: Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
                depth: Some((false, NEARER)),
                constants: Constants::new(),
            },
        );
        let pictures = pipeline(
            device,
            Recipe {
                label: "stage thumbnails",
                module: &overlay,
                entries: ("corner_of_picture", "colour_of_picture"),
                layouts: &[Some(&view_layout), Some(&picture_layout)],
                buffer: Some(wgpu::VertexBufferLayout {
                    array_stride: size_of::<PictureCorner>() as u64,
                    step_mode: wgpu::VertexStepMode::Vertex,
                    attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32, 2 => Float32x2],
                }),
                format: PICTURE_FORMAT,
                blend: None,
                depth: Some((true, NEARER)),
                constants: Constants::new(),
            },
        );
        let sampler = |address_mode_u, mipmap_filter| {
            device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("stage"),
                address_mode_u,
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                mipmap_filter,
                ..Default::default()
            })
        };
        Pipelines {
            surface,
            display,
            meshes: HashMap::new(),
            behinds: HashMap::new(),
            screens: HashMap::new(),
            lines,
            pictures,
            view_layout,
            map_layout,
            light_layout,
            picture_layout,
            screen_layout,
            map_sampler: sampler(wgpu::AddressMode::ClampToEdge, wgpu::MipmapFilterMode::Linear),
            light_sampler: sampler(wgpu::AddressMode::Repeat, wgpu::MipmapFilterMode::Nearest),
        }
    }

    /// What draws the mesh.
    pub fn mesh(&mut self, device: &wgpu::Device, variant: MeshVariant) -> &wgpu::RenderPipeline {
        self.meshes.entry(variant).or_insert_with(|| {
            let recipe = Recipe {
                label: "stage mesh",
                module: &self.surface,
                entries: ("corner_of_mesh", "colour_of_mesh"),
                layouts: &[Some(&self.view_layout), Some(&self.map_layout), Some(&self.light_layout)],
                buffer: Some(wgpu::VertexBufferLayout {
                    array_stride: size_of::<MeshCorner>() as u64,
                    step_mode: wgpu::VertexStepMode::Vertex,
                    attributes: &wgpu::vertex_attr_array![
                        0 => Float32x3, 1 => Float32x3, 2 => Float32x2, 3 => Float16x4
                    ],
                }),
                format: RADIANCE_FORMAT,
                blend: None,
                depth: Some((true, NEARER)),
                constants: variant.constants(),
            };
            pipeline(device, recipe)
        })
    }

    /// What draws the background.
    pub fn behind(&mut self, device: &wgpu::Device, variant: BehindVariant) -> &wgpu::RenderPipeline {
        self.behinds.entry(variant).or_insert_with(|| {
            let recipe = Recipe {
                label: "stage behind",
                module: &self.surface,
                entries: ("corner_behind", "colour_behind"),
                layouts: &[Some(&self.view_layout), Some(&self.map_layout), Some(&self.light_layout)],
                buffer: None,
                format: RADIANCE_FORMAT,
                blend: None,
                depth: Some((false, wgpu::CompareFunction::Always)),
                constants: variant.constants(),
            };
            pipeline(device, recipe)
        })
    }

    /// What makes a picture of the drawn scene.
    pub fn screen(&mut self, device: &wgpu::Device, variant: ScreenVariant) -> &wgpu::RenderPipeline {
        self.screens.entry(variant).or_insert_with(|| {
            let recipe = Recipe {
                label: "stage screen",
                module: &self.display,
                entries: ("corner_of_screen", "colour_of_screen"),
                layouts: &[Some(&self.screen_layout)],
                buffer: None,
                format: PICTURE_FORMAT,
                blend: None,
                depth: None,
                constants: variant.constants(),
            };
            pipeline(device, recipe)
        })
    }
}
