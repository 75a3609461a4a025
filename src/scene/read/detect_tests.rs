use super::*;

#[test]
fn kinds_are_told_apart_and_what_is_passed_over_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    assert_eq!(locate(root).unwrap_err().kind(), ErrorKind::Unsupported);
    std::fs::create_dir_all(root.join("sparse/0")).unwrap();
    for name in ["cameras.txt", "images.txt"] {
        std::fs::write(root.join("sparse/0").join(name), b"").unwrap();
    }
    assert_eq!(locate(root).unwrap().format, Format::Colmap);
    std::fs::write(root.join("other.xml"), b"<?xml version=\"1.0\"?><notes/>").unwrap();
    assert_eq!(locate(root).unwrap().format, Format::Colmap, "XML of another kind is no scene");
    std::fs::write(root.join("transforms.json"), br#"{"frames": [{}]}"#).unwrap();
    let located = locate(root).unwrap();
    assert_eq!(located.format, Format::Transforms);
    assert_eq!(located.why(), "it holds transforms.json; not read as COLMAP, though it holds sparse/0");
    std::fs::write(root.join("p.psx"), b"<document/>").unwrap();
    let located = locate(root).unwrap();
    assert_eq!(located.format, Format::Transforms, "a project without its files");
    assert!(located.why().contains("not read as Metashape project, though it holds p.psx"), "{}", located.why());
    std::fs::create_dir(root.join("p.files")).unwrap();
    std::fs::write(root.join("p.files/project.zip"), b"").unwrap();
    assert_eq!(locate(root).unwrap().format, Format::MetashapeProject);
    std::fs::write(root.join("scene.toml"), b"").unwrap();
    assert_eq!(locate(root).unwrap().format, Format::Manifest);
    assert_eq!(locate(&root.join("p.psx")).unwrap().format, Format::MetashapeProject);
    std::fs::write(root.join("head.out"), b"").unwrap();
    assert_eq!(locate(&root.join("head.out")).unwrap().format, Format::Bundler);
}

#[test]
fn a_whole_model_is_read_whatever_empty_files_lie_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    std::fs::create_dir(root.join("cams")).unwrap();
    assert_eq!(locate(root).unwrap().format, Format::BlendedMvs, "there is nothing else");
    let markers = br#"<?xml version="1.0"?><document version="1.2"><chunk label="x"><markers/></chunk></document>"#;
    std::fs::write(root.join("a_markers.xml"), markers).unwrap();
    std::fs::write(root.join("transforms.json"), br#"{"frames": []}"#).unwrap();
    for name in ["cameras.txt", "images.txt"] {
        std::fs::write(root.join(name), b"").unwrap();
    }
    assert_eq!(locate(root).unwrap().format, Format::Colmap);
    let cameras = "<document><chunk><cameras><camera id=\"0\" label=\"a\"><transform>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\
        </transform></camera></cameras></chunk></document>";
    std::fs::write(root.join("cameras.xml"), cameras).unwrap();
    let located = locate(root).unwrap();
    assert_eq!((located.format, located.evidence), (Format::MetashapeCameras, root.join("cameras.xml")));
    std::fs::write(root.join("cams/00000000_cam.txt"), b"").unwrap();
    assert_eq!(locate(root).unwrap().format, Format::BlendedMvs);
}

#[test]
fn that_nothing_is_aligned_is_told_of_the_file_that_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("transforms.json");
    std::fs::write(&path, br#"{"frames": []}"#).unwrap();
    let error = locate(folder.path()).unwrap().list(&ReadSettings::default()).unwrap_err();
    assert_eq!(error.place(), &Place::File(path));
}

#[test]
fn files_of_other_programs_and_without_their_parts_stand_back() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    std::fs::write(root.join("cameras.json"), br#"[{"id": 0, "img_name": "a", "fx": 1}]"#).unwrap();
    assert_eq!(locate(root).unwrap().format, Format::Exchange, "there is nothing else");
    for name in ["cameras.txt", "images.txt"] {
        std::fs::write(root.join(name), b"").unwrap();
    }
    let located = locate(root).unwrap();
    assert!(located.format == Format::Colmap && located.others[0].0 == Format::Exchange, "{located:?}");
    std::fs::write(root.join("cameras.json"), br#"{"views": []}"#).unwrap();
    assert_eq!(locate(root).unwrap().format, Format::Exchange);
    std::fs::remove_file(root.join("cameras.json")).unwrap();
    std::fs::remove_file(root.join("images.txt")).unwrap();
    std::fs::write(root.join("cameraInit.sfm"), br#"{"views": []}"#).unwrap();
    std::fs::write(root.join("poses_bounds.npy"), b"").unwrap();
    assert_eq!(locate(root).unwrap().format, Format::Llff);
    std::fs::write(root.join("sfm.sfm"), br#"{"poses": [{}]}"#).unwrap();
    assert_eq!(locate(root).unwrap().evidence, root.join("sfm.sfm"));
}
