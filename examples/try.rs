#![allow(warnings, clippy::all)]
use glam::Vec3;
use patina::material::texels::*;
use patina::render::picture::*;
use patina::render::*;
use patina::scene::*;
use patina::*;
use std::sync::atomic::AtomicBool;
use std::time::Instant;
fn main() {
    let t = Instant::now();
    let scene =
        patina::scene::read(std::path::Path::new("/work/shared/peers/scenes/toys"), &Default::default()).unwrap();
    println!("read {:?} tris {} findings {:?}", t.elapsed(), scene.mesh.triangles.len(), scene.findings);
    let truth = scene.truth.as_ref().unwrap();
    let (w, h) = (truth.maps.diffuse.width(), truth.maps.diffuse.height());
    let weights = PyramidWeights::flat(w, h);
    let pyramid = TexelPyramid::from_base(texels_from_maps(&truth.maps), &weights);
    let params = Parameters::new(pyramid, &truth.environment);
    let t = Instant::now();
    let surface = Surface::new(scene.mesh.clone()).unwrap();
    println!("bvh {:?}", t.elapsed());
    let stop = AtomicBool::new(false);
    for depth in [1, 3] {
        for v in [0usize, 17, 33] {
            let s = PictureSettings {
                samples: 16,
                groups: 4,
                max_bounces: depth,
                background_visible: false,
                ..Default::default()
            };
            let t = Instant::now();
            let pic = render(&surface, &scene.views[v].camera, &params, v as u32, &s, &stop);
            let dt = t.elapsed().as_secs_f64();
            let photo = scene.views[v].photo.to_linear();
            let (mut e, mut n, mut sum, mut z, mut zn) = (0.0f64, 0.0f64, 0.0f64, 0.0f64, 0.0f64);
            for (i, (a, b)) in pic.radiance.pixels().iter().zip(photo.pixels()).enumerate() {
                let d = (*a - *b).as_dvec3();
                e += d.length_squared();
                n += b.as_dvec3().length_squared();
                sum += d.element_sum();
                let var = pic.variance.as_ref().unwrap().pixels()[i].as_dvec3();
                if var.x > 0.0 {
                    z += d.x * d.x / var.x;
                    zn += 1.0;
                }
            }
            println!(
                "depth {depth} view {v}: rel rmse {:.4} bias {:.5} mean z2 {:.3}  {:.3} s, {:.2} Msamples/s wall",
                (e / n).sqrt(),
                sum / photo.pixels().iter().map(|p| p.as_dvec3().element_sum()).sum::<f64>(),
                z / zn,
                dt,
                65536.0 * 64.0 / dt / 1e6
            );
        }
    }
}
