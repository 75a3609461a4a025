use super::*;

fn posed(listed: &str) -> Posed {
    let identity = glam::DMat3::IDENTITY;
    let camera = SourceCamera { intrinsics: identity, rotation: identity, translation: glam::DVec3::ZERO };
    let lens = Lens::default();
    Posed { listed: listed.into(), camera, lens, size: None, mask: None, place: Place::Nowhere }
}

#[test]
fn photos_of_kinds_that_are_not_read_are_named_with_the_way_out() {
    let folder = tempfile::tempdir().unwrap();
    // A TIFF with the tag of DNG's version.
    let raw = b"II*\0\x08\0\0\0\x01\0\x12\xc6\x01\0\x04\0\0\0\x01\x04\0\0\0\0\0\0";
    std::fs::write(folder.path().join("a.DNG"), raw).unwrap();
    let index = PhotoIndex::of_folders(&[folder.path().into()]).unwrap();
    for listed in ["a", "C:\\work\\a.jpg"] {
        let error = views_of(vec![posed(listed)], &index, &[], &mut Vec::new()).unwrap_err();
        assert!(error.kind() == ErrorKind::Unsupported && error.remedy_text().contains("develop"), "{error}");
    }
    std::fs::write(folder.path().join("c.nef"), b"II*\0").unwrap();
    let index = PhotoIndex::of_folders(&[folder.path().into()]).unwrap();
    let error = views_of(vec![posed("c")], &index, &[], &mut Vec::new()).unwrap_err();
    assert!(error.kind() == ErrorKind::Unsupported && error.remedy_text().contains("develop"), "{error}");
    let error = views_of(vec![posed("b")], &index, &[], &mut Vec::new()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Missing);
    std::fs::create_dir(folder.path().join("images_2")).unwrap();
    std::fs::write(folder.path().join("images_2/b.png"), b"").unwrap();
    let index = PhotoIndex::of_folders(&[folder.path().into()]).unwrap();
    let mut findings = Vec::new();
    views_of(vec![posed("a"), posed("b")], &index, &[], &mut findings).unwrap();
    assert!(findings[0].code == "camera-without-photo" && findings[0].message.contains("a"));
    assert!(findings[1].code == "photos-smaller" && findings[1].message.contains("images_2"));
}

fn folder_of(files: &[&str]) -> (tempfile::TempDir, PhotoIndex) {
    let folder = tempfile::tempdir().unwrap();
    for file in files {
        let path = folder.path().join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, b"").unwrap();
    }
    let index = PhotoIndex::of_folders(&[folder.path().to_path_buf()]).unwrap();
    (folder, index)
}

#[test]
fn masks_are_used_wherever_programs_put_them_and_told_of_elsewhere() {
    for mask in ["Masks/a.png", "mask/a.png", "images/masks/a.png", "silhouettes/a.png", "images/a.png.mask.png"] {
        let (folder, index) = folder_of(&["images/a.png", mask]);
        let mut findings = Vec::new();
        let views = views_of(vec![posed("a.png")], &index, &[folder.path().into()], &mut findings).unwrap();
        assert_eq!(views[0].mask, Some(folder.path().join(mask)));
        assert!(findings.is_empty(), "{findings:?}");
    }
    let (folder, index) = folder_of(&["images/a.png", "object_masks/a.png"]);
    let mut findings = Vec::new();
    views_of(vec![posed("a.png")], &index, &[folder.path().into()], &mut findings).unwrap();
    assert_eq!(findings[0].code, "masks-unread");
}

#[test]
fn masks_that_the_project_names_belong_to_their_photos() {
    let (folder, index) = folder_of(&["images/a.png", "masks/m_of_it.png"]);
    let own = Posed { mask: Some(folder.path().join("./masks/m_of_it.png")), ..posed("a.png") };
    let mut findings = Vec::new();
    views_of(vec![own], &index, &[folder.path().into()], &mut findings).unwrap();
    assert!(findings.is_empty(), "{findings:?}");
}

#[test]
fn a_photo_has_one_camera() {
    let (_folder, index) = folder_of(&["images/left/a.png", "images/b.png"]);
    let views = |listed: Vec<Posed>| {
        let mut findings = Vec::new();
        views_of(listed, &index, &[], &mut findings).map(|views| (views, findings))
    };
    let (same, findings) = views(vec![posed("b.png"), posed("b.png")]).unwrap();
    assert!(same.len() == 1 && findings[0].code == "photo-listed-twice", "{findings:?}");
    let moved = |listed: &str| {
        let mut own = posed(listed);
        own.camera.translation.x = 1.0;
        own
    };
    let error = views(vec![posed("b.png"), moved("b.png")]).unwrap_err();
    assert!(error.message().contains("b.png is listed twice"), "{error}");
    let error = views(vec![posed("b.png"), moved("b.jpg")]).unwrap_err();
    assert!(error.message().contains("b.png and b.jpg lead to one photo"), "{error}");
    // The photo of the other folder is not here.
    for listed in [["right/a.png", "left/a.png"], ["left/a.png", "right/a.png"]] {
        let (own, findings) = views(listed.map(moved).into()).unwrap();
        assert!(own.len() == 1 && findings[0].message.contains("right/a.png"), "{findings:?}");
    }
}

#[test]
fn of_two_files_that_fit_alike_both_are_named() {
    let (_folder, index) = folder_of(&["a.png", "a.tif", "b.png"]);
    let error = views_of(vec![posed("a.jpg")], &index, &[], &mut Vec::new()).unwrap_err();
    assert!(error.message().contains("a.png") && error.message().contains("a.tif"), "{error}");
    let mut findings = Vec::new();
    assert_eq!(views_of(vec![posed("a.jpg"), posed("b.png")], &index, &[], &mut findings).unwrap().len(), 1);
    assert_eq!(findings[0].code, "photo-ambiguous");
}
