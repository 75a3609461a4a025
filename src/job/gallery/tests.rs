use super::*;

#[test]
fn a_turned_camera_sees_the_turned_point_where_it_was() {
    let centre = Vec3::new(0.4, 0.2, -0.3);
    let camera = Camera::looking_at(Vec3::new(3.0, 2.0, 5.0), Vec3::new(0.1, 0.4, 0.0), 320, 200, 0.7);
    let point = Vec3::new(-0.3, 0.9, 0.7);
    for radians in [0.0, 0.4, 3.0] {
        let turned = turned_about(&camera, centre, radians);
        turned.validate(1e-5).unwrap();
        let moved = Mat3::from_rotation_y(radians) * (point - centre) + centre;
        let (before, after) = (camera.project(point).unwrap(), turned.project(moved).unwrap());
        assert!((before.0 - after.0).length() < 1e-2 && (before.1 - after.1).abs() < 1e-4);
    }
}

#[test]
fn the_first_camera_has_the_mesh_in_its_picture_at_any_size() {
    let corner = |index: usize| Vec3::from_array(std::array::from_fn(|axis| (index >> axis & 1) as f32 * 2.0 + 5.0));
    let mesh = Mesh {
        positions: (0..8).map(corner).collect(),
        triangles: vec![[0, 1, 2], [3, 4, 5], [5, 6, 7]],
        ..Default::default()
    };
    for size in [(320, 200), (100, 300), (64, 64)] {
        for frame in 0..7 {
            let settings = TurntableSettings { frames: 7, size, turning: Turning::Camera, start: None };
            let camera = camera_of_frame(&mesh, &settings, frame);
            for &position in &mesh.positions {
                let (place, _) = camera.project(position).unwrap();
                let inside = place.cmpge(Vec2::ZERO).all() && place.x <= size.0 as f32 && place.y <= size.1 as f32;
                assert!(inside, "{size:?}: {place}");
            }
        }
    }
    let start = Camera::looking_at(Vec3::splat(20.0), Vec3::splat(6.0), 160, 120, 0.7);
    let settings = TurntableSettings { frames: 4, size: (320, 120), turning: Turning::Light, start: Some(start) };
    let wide = camera_of_frame(&mesh, &settings, 1);
    assert_eq!((wide.focal_pixels, wide.centre_pixels), (start.focal_pixels, Vec2::new(160.0, 60.0)));
}
