#[path = "metashape_project_tests.rs"]
mod of_project;

use super::super::zip::packed;
use super::*;
use crate::image::{Image, file};
use glam::{DMat3, DVec2, DVec3};
use std::path::Path;

/// Exported cameras of two sensors, in the words of version 1.5: offsets, affinity, P1 and P2 in Agisoft's order.
const EXPORT: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<document version="1.5.0"><chunk label="Chunk 1" enabled="1">
 <sensors>
  <sensor id="0" type="frame"><resolution width="40" height="30"/>
   <calibration type="frame" class="adjusted"><resolution width="40" height="30"/>
    <f>50</f><cx>0.5</cx><cy>-0.25</cy><b1>1</b1><b2>0.5</b2><k1>0.1</k1><p1>0.001</p1><p2>0.002</p2></calibration></sensor>
  <sensor id="1" type="fisheye"><resolution width="40" height="30"/>
   <calibration type="fisheye" class="adjusted"><f>20</f></calibration></sensor>
 </sensors>
 <cameras>
  <camera id="0" sensor_id="0" label="a"><transform>1 0 0 1 0 -1 0 2 0 0 -1 3 0 0 0 1</transform></camera>
  <group label="g"><camera id="1" sensor_id="1" label="b.png"><transform>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</transform></camera></group>
  <camera id="2" sensor_id="0" label="c"/>
  <camera id="3" sensor_id="0" label="d" enabled="0"><transform>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</transform></camera>
 </cameras>
 <transform><rotation>0 -1 0 1 0 0 0 0 1</rotation><translation>1 2 3</translation><scale>2</scale></transform>
</chunk></document>"#;

fn folder_with_photos(photos: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for photo in photos {
        file::write_png_srgb8(&folder.path().join(photo), &Image::filled(40, 30, [90, 100, 110])).unwrap();
    }
    folder
}

#[test]
fn exported_cameras_follow_the_manual() {
    let folder = folder_with_photos(&["a.png", "b.png"]);
    std::fs::write(folder.path().join("cameras.xml"), EXPORT).unwrap();
    let scene = read_export(&export_of(folder.path()).unwrap(), None).unwrap();
    assert_eq!(scene.views.len(), 2);
    let view = &scene.views[0];
    // The manual's formulas by hand at x = 0.3, y = 0.4, r² = 0.25.
    let (x, y) = (0.3, 0.4);
    let radial = 1.0 + 0.1 * 0.25;
    let u = x * radial + 0.001 * (0.25 + 2.0 * x * x) + 2.0 * 0.002 * x * y;
    let v = y * radial + 0.002 * (0.25 + 2.0 * y * y) + 2.0 * 0.001 * x * y;
    let expected = DVec2::new(20.0 + 0.5 + u * 50.0 + u * 1.0 + v * 0.5, 15.0 - 0.25 + v * 50.0);
    let pinhole = view.camera.pinhole();
    let place =
        view.lens.as_ref().unwrap().project(DVec3::new(x, y, 1.0)) * pinhole.focal_pixels + pinhole.centre_pixels;
    assert!((place - expected).length() < 1e-9, "{place} {expected}");
    let position = view.camera.rotation.transpose() * -view.camera.translation;
    assert!((position - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
    assert!(scene.views[1].lens.as_ref().unwrap().model.is_on_angles());
    let codes: Vec<_> = scene.findings.iter().map(|finding| finding.code).collect();
    assert!(codes.contains(&"camera-not-aligned") && codes.contains(&"camera-disabled"), "{codes:?}");
    let frame = &scene.mesh_frames[0].source_from_mesh;
    // 2 R (5, 6, 7) + (1, 2, 3) is taken back.
    assert!((frame.transform_point3(DVec3::new(-11.0, 12.0, 17.0)) - DVec3::new(5.0, 6.0, 7.0)).length() < 1e-12);
}

#[test]
fn the_chunk_whose_photos_are_here_is_read_unless_another_is_asked_for() {
    let folder = folder_with_photos(&["a.png", "b.png"]);
    let root = folder.path().join("p.files");
    let chunk = |label: &str, label_photo: &str| {
        format!(
            r#"<chunk label="{label}"><sensors><sensor id="0" type="frame"><resolution width="40" height="30"/>
            <calibration type="frame" class="adjusted"><fx>50</fx><fy>50</fy><cx>20</cx><cy>15</cy></calibration></sensor></sensors>
            <cameras><camera id="7" label="{label_photo}" sensor_id="0"><transform>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</transform></camera></cameras>
            <frames><frame id="0" path="0/frame.zip"/></frames></chunk>"#
        )
    };
    let frame = |path: &str| {
        format!(
            r#"<frame><cameras><camera camera_id="7"><photo path="{path}"/></camera></cameras>
            <masks path="masks/masks.zip"/></frame>"#
        )
    };
    let write = |path: &str, text: &str| {
        let path = root.join(path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, packed(&[("doc.xml", text.as_bytes())])).unwrap();
    };
    write(
        "project.zip",
        r#"<document version="1.2.0"><chunks><chunk id="0" path="0/chunk.zip"/><chunk id="3" path="3/chunk.zip"/></chunks></document>"#,
    );
    let mask = Image::from_fn(80, 60, |_, column| if column < 20 { [255u8; 3] } else { [0; 3] });
    let mask = file::encode_png_srgb8(&mask).unwrap();
    std::fs::create_dir_all(root.join("3/0/masks")).unwrap();
    std::fs::write(
        root.join("3/0/masks/masks.zip"),
        packed(&[("doc.xml", br#"<masks><mask camera_id="7" path="c7.png"/></masks>"#), ("c7.png", &mask)]),
    )
    .unwrap();
    write("0/chunk.zip", &chunk("Elsewhere", "x.png"));
    write("0/0/frame.zip", &frame("../../far/x.png"));
    write("3/chunk.zip", &chunk("Here", "renamed"));
    write("3/0/frame.zip", &frame("../../far/b.png"));
    let project = folder.path().join("p.psx");
    std::fs::write(&project, r#"<document version="1.2.0" path="{projectname}.files/project.zip"/>"#).unwrap();
    let scene = read_project(&project, None).unwrap();
    assert_eq!((scene.views.len(), scene.views[0].name.as_str()), (1, "b"));
    assert!(scene.findings[0].message.contains("Here"), "{}", scene.findings[0]);
    assert_eq!(scene.views[0].mask, Some(root.join("3/0/masks/masks.zip/c7.png")));
    // The mask is of the size the photo was masked at, twice that of the photo that is here.
    let settings = crate::scene::ReadSettings::default();
    let loaded = super::super::photos::load_all(
        &scene.views,
        &[(40, 30)],
        Default::default(),
        (None, &Default::default()),
        &settings,
    )
    .unwrap();
    let object = loaded[0].states.pixels().iter().filter(|state| state.is_surface()).count();
    assert_eq!(object, 10 * 30);
    assert_eq!(read_project(&project, Some("0")).unwrap_err().kind(), ErrorKind::Missing, "its photo is not here");
    let error = read_project(&project, Some("no")).unwrap_err();
    assert!(error.remedy_text().contains("--chunk") && error.remedy_text().contains("Elsewhere (0)"), "{error}");
    write("project.zip", r#"<document><chunks><chunk id="0" path="../../outside.zip"/></chunks></document>"#);
    assert_eq!(read_project(&project, None).unwrap_err().kind(), ErrorKind::Malformed);
}

const EYE: &str = "<transform>1 0 0 1 0 1 0 2 0 0 1 3 0 0 0 1</transform>";

/// Exported cameras of version 2 with one sensor `0`; what stands for a chunk's cameras is given.
fn export(chunks: &[(&str, &str)]) -> String {
    let chunk = |(label, inner): &(&str, &str)| {
        format!(
            r#"<chunk label="{label}"><sensors>
            <sensor id="0" type="frame"><resolution width="40" height="30"/><calibration class="adjusted"><f>50</f></calibration></sensor>
            <sensor id="1" type="frame"><resolution width="40" height="30"/></sensor>
            <sensor id="2" type="spherical"><resolution width="9" height="5"/><calibration type="spherical"/></sensor>
            <sensor id="3" type="frame" master_id="0"><resolution width="40" height="30"/><calibration><f>50</f></calibration></sensor>
            </sensors>{inner}</chunk>"#
        )
    };
    let chunks: String = chunks.iter().map(chunk).collect();
    format!(r#"<?xml version="1.0"?><document version="2.0.0">{chunks}</document>"#)
}

fn read_text_of(folder: &Path, text: &str, chunk: Option<&str>) -> Result<SourceScene> {
    std::fs::write(folder.join("cameras.xml"), text).unwrap();
    read_export(&folder.join("cameras.xml"), chunk)
}

fn codes(scene: &SourceScene) -> Vec<&str> {
    scene.findings.iter().map(|finding| finding.code).collect()
}

#[test]
fn components_have_transforms_and_cameras_of_others_are_brought_over() {
    let folder = folder_with_photos(&["a.png", "b.png", "c.png"]);
    let component = |id: &str, translation: &str, scale: &str| {
        format!(
            r#"<component id="{id}"><transform><rotation>1 0 0 0 1 0 0 0 1</rotation>
            <translation>{translation}</translation><scale>{scale}</scale></transform></component>"#
        )
    };
    let cameras = format!(
        r#"<cameras><camera id="0" sensor_id="0" component_id="0" label="a">{EYE}</camera>
        <camera id="1" sensor_id="0" component_id="0" label="b">{EYE}</camera>
        <camera id="2" sensor_id="0" component_id="1" label="c">{EYE}</camera></cameras>"#
    );
    let components = component("0", "500000 4000000 100", "2") + &component("1", "500010 4000000 100", "4");
    let inner = format!(r#"<components active_id="0">{components}</components>{cameras}"#);
    let scene = read_text_of(folder.path(), &export(&[("1", &inner)]), None).unwrap();
    assert_eq!(scene.views.len(), 3);
    let to_mesh = &scene.mesh_frames[0].source_from_mesh;
    assert!(
        (to_mesh.transform_point3(DVec3::new(500_002.0, 4_000_004.0, 106.0)) - DVec3::new(1.0, 2.0, 3.0)).length()
            < 1e-6
    );
    // 4 (1, 2, 3) + (10, 0, 0) in the world, seen from the first component: half of that.
    let position = |index: usize| {
        let camera = &scene.views[index].camera;
        camera.rotation.transpose() * -camera.translation
    };
    assert!((position(0) - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-9);
    assert!((position(2) - DVec3::new(7.0, 4.0, 6.0)).length() < 1e-6, "{}", position(2));
    assert!((scene.views[2].camera.rotation - DMat3::IDENTITY).to_cols_array().iter().all(|own| own.abs() < 1e-9));
    let unknown = format!(r#"<components active_id="0"><component id="0"/><component id="1"/></components>{cameras}"#);
    let scene = read_text_of(folder.path(), &export(&[("1", &unknown)]), None).unwrap();
    assert_eq!((scene.views.len(), scene.mesh_frames.len()), (2, 0));
    assert_eq!(codes(&scene)[..1], ["camera-of-other-component"]);
}

#[test]
fn of_several_exported_chunks_one_is_chosen_and_told() {
    let folder = folder_with_photos(&["a.png", "b.png"]);
    let camera =
        |label: &str| format!(r#"<cameras><camera id="0" sensor_id="0" label="{label}">{EYE}</camera></cameras>"#);
    let text = export(&[("far", &camera("x")), ("near", &camera("a")), ("also", &camera("b"))]);
    let name = |chunk| read_text_of(folder.path(), &text, chunk).map(|scene| scene.views[0].name.clone());
    assert_eq!(name(None).unwrap(), "a");
    assert_eq!(name(Some("also")).unwrap(), "b");
    assert_eq!(name(Some("2")).unwrap(), "b");
    let error = name(Some("nonsense")).unwrap_err();
    assert!(error.kind() == ErrorKind::InvalidSetting && error.remedy_text().contains("near (1)"), "{error}");
    let scene = read_text_of(folder.path(), &text, None).unwrap();
    assert!(scene.findings[0].code == "chunk-chosen" && scene.findings[0].message.contains("near"));
}

#[test]
fn what_no_camera_uses_is_not_read_and_rigs_and_sensors_without_calibration_are_named() {
    let folder = folder_with_photos(&["a.png", "b.png"]);
    let cameras = format!(
        r#"<cameras><camera id="0" sensor_id="0" label="a">{EYE}</camera><camera id="1" sensor_id="3" label="s"/>
        <camera id="2" sensor_id="1" label="b">{EYE}</camera><camera id="3" sensor_id="2" label="u"/></cameras>"#
    );
    let scene = read_text_of(folder.path(), &export(&[("1", &cameras)]), None).unwrap();
    assert_eq!(scene.views.len(), 1);
    assert_eq!(codes(&scene)[..3], ["camera-not-aligned", "camera-of-rig", "camera-not-calibrated"]);
    let none = format!(r#"<cameras><camera id="2" sensor_id="1" label="b">{EYE}</camera></cameras>"#);
    let error = read_text_of(folder.path(), &export(&[("1", &none)]), None).unwrap_err();
    assert!(error.kind() == ErrorKind::Missing && error.to_string().contains("no calibration"), "{error}");
    let used = format!(r#"<cameras><camera id="3" sensor_id="2" label="b">{EYE}</camera></cameras>"#);
    let error = read_text_of(folder.path(), &export(&[("1", &used)]), None).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Unsupported);
    let unaligned = r#"<cameras><camera id="3" sensor_id="0" label="b"/></cameras>"#;
    let error = read_text_of(folder.path(), &export(&[("1", unaligned)]), None).unwrap_err();
    assert!(error.to_string().contains("no camera has a pose"), "{error}");
}

#[test]
fn slaves_of_a_rig_stand_where_their_sensors_put_them() {
    let folder = folder_with_photos(&["a.png", "b.png", "c.png"]);
    // The slave stands two units to the right of the master and one nearer to the scene, and looks to the master's left: its
    // axes are the columns.
    let offset = "<rotation fixed=\"true\">0 0 -1 0 1 0 1 0 0</rotation><location fixed=\"true\">2 0 1</location>";
    // The master stands at (1, 2, 3), a quarter turn about its own z.
    let turned = "<transform>0 -1 0 1 1 0 0 2 0 0 1 3 0 0 0 1</transform>";
    let cameras = format!(
        r#"<cameras><camera id="0" sensor_id="0" label="a">{turned}</camera>
        <camera id="1" sensor_id="3" master_id="0" label="b"/><camera id="2" sensor_id="3" master_id="7" label="c"/></cameras>"#
    );
    let with = |offset: &str| {
        let slave = r#"<sensor id="3" type="frame" master_id="0">"#;
        export(&[("1", &cameras)]).replace(slave, &format!("{slave}{offset}"))
    };
    let scene = read_text_of(folder.path(), &with(offset), None).unwrap();
    assert_eq!(scene.views.len(), 2);
    let camera = &scene.views[1].camera;
    let source_from_camera = camera.rotation.transpose();
    let position = source_from_camera * -camera.translation;
    // (2, 0, 1) of the master is (0, 2, 1) of the chunk; its left, -x, is -y.
    assert!((position - DVec3::new(1.0, 4.0, 4.0)).length() < 1e-12, "{position}");
    assert!((source_from_camera * DVec3::Z - DVec3::NEG_Y).length() < 1e-12);
    assert!((source_from_camera * DVec3::X - DVec3::Z).length() < 1e-12);
    assert_eq!(codes(&scene)[..2], ["camera-on-rig", "camera-of-rig"]);
    assert!(scene.findings[1].message.ends_with(": c"), "its master is not there: {}", scene.findings[1]);
    // Without an offset, or with one from another sensor than the master's, nothing is known.
    for unknown in ["<rotation fixed=\"true\"/><location/>".to_owned(), offset.replace("2 0 1", "2 0")] {
        let scene = read_text_of(folder.path(), &with(&unknown), None).unwrap();
        assert_eq!((scene.views.len(), codes(&scene)[0]), (1, "camera-of-rig"), "{unknown}");
    }
    let other = with(offset).replace(r#"type="frame" master_id="0""#, r#"type="frame" master_id="1""#);
    let scene = read_text_of(folder.path(), &other, None).unwrap();
    assert_eq!((scene.views.len(), codes(&scene)[0]), (1, "camera-of-rig"));
}
