use super::*;
use crate::scene::demo::{DemoSettings, build};
use glam::Vec3;

fn waited(relighter: &Relighter, key: u64, is_fine: bool) -> Arc<RelitPictures> {
    loop {
        if let Some((_, made)) = relighter.pictures.newest()
            && made.key == key
            && made.is_fine == is_fine
        {
            return made;
        }
        assert!(relighter.failures.newest().is_none());
        std::thread::yield_now();
    }
}

#[test]
fn a_light_that_turns_costs_no_ray_and_a_view_ends_smooth() {
    let settings =
        DemoSettings { views: 1, held_out: 0, width: 96, height: 72, map_size: 64, seed: 1, ..Default::default() };
    let scene = build(&settings).unwrap().scene;
    let surface = Arc::new(Surface::new(scene.mesh.clone()).unwrap());
    let truth = scene.truth.as_ref().unwrap();
    let cached =
        CachedSettings { grid: 32, bounce_rays: 8, max_bounces: 2, ..settings_of(2, Some(LobeModel::BlinnPhong)) };
    let transport = CachedTransport::build(&surface, cached, (16, 8), &AtomicBool::new(false)).unwrap();
    let environment = Arc::new(truth.environment.clone());
    let light = |turn_radians, strength| RelitLight { environment: Arc::clone(&environment), turn_radians, strength };
    let first = RelitRequest {
        surface,
        transport: Arc::new(transport),
        maps: Arc::new(truth.maps.clone()),
        camera: scene.views[0].camera,
        lights: vec![light(0.0, 1.0), light(0.0, 2.0)],
        background_visible: false,
        background_blur_degrees: 0.0,
        is_settled: true,
        key: 1,
        view: 7,
    };
    let relighter = Relighter::start(None).unwrap();
    relighter.request(first.clone(), true);
    let smooth = waited(&relighter, 1, true);
    assert_eq!((smooth.pictures.len(), smooth.view), (2, 7));
    // Twice the strength is twice the radiance.
    let sum = |picture: &RgbImage| picture.pixels().iter().copied().sum::<Vec3>();
    let [one, two] = [0, 1].map(|light| sum(&smooth.pictures[light]));
    assert!(one.min_element() > 0.0 && (two / one - 2.0).abs().max_element() < 1e-4, "{one} {two}");
    // The same view under a turned light is smooth from the start.
    let lights = vec![light(1.5, 1.0)];
    relighter.request(RelitRequest { lights, key: 2, ..first.clone() }, false);
    let turned = waited(&relighter, 2, true);
    assert!(turned.pictures[0] != smooth.pictures[0] && smooth.is_of_new_view && !turned.is_of_new_view);
    // Another eye begins with one ray a pixel.
    let camera = crate::scene::Camera { focal_pixels: first.camera.focal_pixels * 1.3, ..first.camera };
    relighter.request(RelitRequest { camera, key: 3, view: 8, ..first }, true);
    let nearer = waited(&relighter, 3, true);
    assert!(nearer.pictures[0] != smooth.pictures[0]);
}
