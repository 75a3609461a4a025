use super::*;

#[test]
fn photos_and_their_masks_are_found_in_either_form_of_unicode() {
    let [apart, whole] = ["e\u{301}te\u{301}", "\u{e9}t\u{e9}"];
    for (stored, listed) in [(apart, whole), (whole, apart)] {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        for file in ["images/S/S.png", "images/other/S.png", "images/S/S_mask.png"] {
            let path = root.join(file.replace('S', stored));
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, b"").unwrap();
        }
        let index = PhotoIndex::of_folders(&[root.join("images")]).unwrap();
        let photo = root.join("images/S/S.png".replace('S', stored));
        assert_eq!(index.find(&"S/S.png".replace('S', listed)), Some(photo.clone()), "the folder tells them apart");
        assert_eq!(index.find(&"far/S/S".replace('S', listed)), Some(photo.clone()));
        assert_eq!(index.mask_beside(&photo), Some(root.join("images/S/S_mask.png".replace('S', stored))));
    }
}

#[test]
fn photos_are_found_by_the_end_of_their_path() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for file in ["images/left/0001.JPG", "images/right/0001.JPG", "images/b.png", "images_2/b.png", "masks/b.png"] {
        let path = root.join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, b"").unwrap();
    }
    let index = PhotoIndex::of_folders(&[root.join("images"), root.to_path_buf()]).unwrap();
    let found = |listed: &str| index.find(listed).map(|path| path.strip_prefix(root).unwrap().to_path_buf());
    assert_eq!(found("left/0001.JPG").unwrap(), Path::new("images/left/0001.JPG"));
    assert_eq!(found("C:\\work\\right\\0001.jpg").unwrap(), Path::new("images/right/0001.JPG"));
    assert_eq!(found("0001.JPG"), None, "two fit equally well");
    assert_eq!(found("../elsewhere/b.png").unwrap(), Path::new("images/b.png"));
    assert_eq!(found("./b").unwrap(), Path::new("images/b.png"));
    assert_eq!(found("c.png"), None);
    assert_eq!(index.below_root(&root.join("images/left/0001.JPG")), Path::new("left/0001.JPG"));
    std::fs::write(root.join("images/b_mask.png"), b"").unwrap();
    let index = PhotoIndex::of_folders(&[root.join("images")]).unwrap();
    assert_eq!(index.mask_beside(&root.join("images/b.png")), Some(root.join("images/b_mask.png")));
    assert_eq!(index.mask_beside(&root.join("images/left/0001.JPG")), None);
    for file in ["images_4/d.png", "images_2/d.png", "images_8/e.png", "part_2/f.png", "part_3/f.png"] {
        std::fs::create_dir_all(root.join(file).parent().unwrap()).unwrap();
        std::fs::write(root.join(file), b"").unwrap();
    }
    let index = PhotoIndex::of_folders(&[root.join("images"), root.to_path_buf()]).unwrap();
    let found = |listed: &str| index.find(listed).map(|path| path.strip_prefix(root).unwrap().to_path_buf());
    assert_eq!(found("images/d.png").unwrap(), Path::new("images_2/d.png"), "the larger one");
    assert_eq!(found("e.png").unwrap(), Path::new("images_8/e.png"));
    assert_eq!(found("f.png"), None, "parts are not sizes");
    std::fs::create_dir(root.join("images/left_mask")).unwrap();
    std::fs::write(root.join("images/left_mask/0001.png"), b"").unwrap();
    let index = PhotoIndex::of_folders(&[root.join("images")]).unwrap();
    let mask = index.mask_beside(&root.join("images/left/0001.JPG"));
    assert_eq!(mask, Some(root.join("images/left_mask/0001.png")));
    assert_eq!(index.mask_beside(&root.join("images/right/0001.JPG")), None);
}

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
