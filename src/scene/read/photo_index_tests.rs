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

#[test]
fn names_with_points_are_whole_and_masks_bear_the_whole_name_of_their_photo() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for file in ["IMG.png", "IMG.1.png", "IMG.png.mask.png", "b.png", "b.tif"] {
        std::fs::write(root.join(file), b"").unwrap();
    }
    let index = PhotoIndex::of_folders(&[root.to_path_buf()]).unwrap();
    assert_eq!(index.find("IMG.1"), Some(root.join("IMG.1.png")));
    assert_eq!(index.find("IMG"), Some(root.join("IMG.png")));
    assert_eq!(index.find("IMG.jpg"), Some(root.join("IMG.png")), "an extension of photos is one");
    assert_eq!(index.mask_beside(&root.join("IMG.png")), Some(root.join("IMG.png.mask.png")));
    assert_eq!(index.find("b.jpg"), None);
    assert_eq!(index.fitting("b.jpg").len(), 2);
}

#[test]
fn a_photo_is_read_from_where_it_is_listed_unless_it_is_under_the_folder() {
    let (folder, elsewhere) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let listed = elsewhere.path().join("a.png");
    std::fs::write(&listed, b"").unwrap();
    let listed_text = listed.to_string_lossy().into_owned();
    let index = || PhotoIndex::of_folders(&[folder.path().to_path_buf()]).unwrap();
    assert_eq!(index().find(&listed_text), Some(listed));
    std::fs::write(folder.path().join("a.png"), b"").unwrap();
    assert_eq!(index().find(&listed_text), Some(folder.path().join("a.png")));
}
