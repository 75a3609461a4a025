//! Projects: where their photos and models lie, and which of several is read.

use super::*;

/// The chunk and the frame of a project with one photo, whose path is given.
fn one_photo(path: &str, model: &str) -> [String; 2] {
    let chunk = format!(
        r#"<chunk id="0" label="One"><sensors><sensor id="0" type="frame"><resolution width="40" height="30"/>
        <calibration class="adjusted"><f>50</f></calibration></sensor></sensors>
        <cameras><camera id="7" label="a" sensor_id="0">{EYE}</camera></cameras>"#
    );
    let frame =
        format!(r#"<frame><cameras><camera camera_id="7"><photo path="{path}"/></camera></cameras>{model}</frame>"#);
    [chunk, frame]
}

fn put_project(folder: &Path, path: &str, model: &str) -> PathBuf {
    let root = folder.join("p.files");
    std::fs::create_dir_all(root.join("0/0/model")).unwrap();
    let [chunk, frame] = one_photo(path, model);
    let chunk = format!(r#"{chunk}<frames><frame id="0" path="0/frame.zip"/></frames></chunk>"#);
    let listing = r#"<document><chunks><chunk id="0" path="0/chunk.zip"/></chunks></document>"#;
    for (path, text) in [("project.zip", listing), ("0/chunk.zip", &chunk), ("0/0/frame.zip", &frame)] {
        std::fs::write(root.join(path), packed(&[("doc.xml", text.as_bytes())])).unwrap();
    }
    let project = folder.join("p.psx");
    std::fs::write(&project, r#"<document path="{projectname}.files/project.zip"/>"#).unwrap();
    project
}

#[test]
fn photos_of_a_project_are_written_from_the_folder_of_their_frame() {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path().join("work/project");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::create_dir_all(outer.path().join("work/photos")).unwrap();
    file::write_png_srgb8(&outer.path().join("work/photos/a.png"), &Image::filled(40, 30, [9; 3])).unwrap();
    let project = put_project(&folder, "../../../../photos/a.png", "");
    let scene = read_project(&project, None).unwrap();
    let canonical = |path: &Path| std::fs::canonicalize(path).unwrap();
    assert_eq!(canonical(&scene.views[0].photo), canonical(&outer.path().join("work/photos/a.png")));
    assert!(scene.findings.iter().any(|finding| finding.code == "photos-elsewhere"), "{:?}", scene.findings);
    // Four folders up, which is not where the scene is.
    std::fs::remove_dir_all(outer.path().join("work/photos")).unwrap();
    std::fs::create_dir_all(outer.path().join("photos")).unwrap();
    file::write_png_srgb8(&outer.path().join("photos/a.png"), &Image::filled(40, 30, [9; 3])).unwrap();
    assert_eq!(read_project(&project, None).unwrap_err().kind(), ErrorKind::Missing);
}

#[test]
fn the_model_of_a_project_is_read_where_there_is_no_other() {
    let folder = folder_with_photos(&["a.png"]);
    let project = put_project(folder.path(), "../../../a.png", r#"<model id="0" path="model/model.zip"/>"#);
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
               element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let model = packed(&[("doc.xml", br#"<model><mesh path="mesh.ply"/></model>"#), ("mesh.ply", ply.as_bytes())]);
    std::fs::write(folder.path().join("p.files/0/0/model/model.zip"), model).unwrap();
    let scene = read_project(&project, None).unwrap();
    assert_eq!(scene.mesh, [folder.path().join("p.files/0/0/model/model.zip/mesh.ply")]);
    assert_eq!(super::super::super::mesh_file::read_pieces(&scene.mesh).unwrap().triangles.len(), 1);
    assert!(scene.findings.iter().any(|finding| finding.code == "mesh-of-project"));
    std::fs::write(folder.path().join("own.ply"), ply).unwrap();
    assert_eq!(read_project(&project, None).unwrap().mesh, [folder.path().join("own.ply")]);
}

#[test]
fn a_project_of_one_archive_is_read_and_of_several_the_one_with_the_photos() {
    let folder = folder_with_photos(&["a.png"]);
    let [chunk, frame] = one_photo("a.png", "");
    let text =
        format!("<document version=\"1.2.0\"><chunks>{chunk}<frames>{frame}</frames></chunk></chunks></document>");
    std::fs::write(folder.path().join("b.psz"), packed(&[("doc.xml", text.as_bytes())])).unwrap();
    let scene = read_project(&project_of(folder.path()).unwrap(), None).unwrap();
    assert_eq!((scene.views.len(), scene.views[0].name.as_str()), (1, "a"));
    let old = text.replace("a.png", "gone.png");
    std::fs::write(folder.path().join("a_old.psz"), packed(&[("doc.xml", old.as_bytes())])).unwrap();
    let project = project_of(folder.path()).unwrap();
    assert_eq!(project, folder.path().join("b.psz"));
    let told = read_project(&project, None).unwrap().findings;
    assert!(told.iter().any(|own| own.code == "project-chosen" && own.message.contains("a_old.psz")), "{told:?}");
}

#[test]
fn groups_tell_photos_of_one_label_apart() {
    let folder = tempfile::tempdir().unwrap();
    for (group, grey) in [("100", 10), ("101", 20)] {
        std::fs::create_dir_all(folder.path().join(group)).unwrap();
        file::write_png_srgb8(&folder.path().join(group).join("a.png"), &Image::filled(40, 30, [grey; 3])).unwrap();
    }
    let group = |label: &str, id: u32| {
        format!(r#"<group label="{label}"><camera id="{id}" sensor_id="0" label="a">{EYE}</camera></group>"#)
    };
    let cameras = format!("<cameras>{}{}</cameras>", group("100", 0), group("101", 1));
    std::fs::write(folder.path().join("cameras.xml"), export(&[("One", &cameras)])).unwrap();
    let scene = read_export(&export_of(folder.path()).unwrap(), None).unwrap();
    let photos: Vec<_> = scene.views.iter().map(|view| view.photo.clone()).collect();
    assert_eq!(photos, ["100", "101"].map(|group| folder.path().join(group).join("a.png")));
}
