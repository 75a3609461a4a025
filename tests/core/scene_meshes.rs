//! Meshes and text files as programs write them: each kind of file is read with the right surface, and what was left
//! out is told.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)]

use super::scene_fixture::folder;
use glam::Vec3;
use patina::scene::{Mesh, read_mesh};
use patina::{Finding, Place};
use std::path::Path;

pub fn read(name: &str, content: impl AsRef<[u8]>) -> (Mesh, Vec<Finding>) {
    let (_keep, folder) = folder();
    let path = folder.join(name);
    std::fs::write(&path, content).unwrap();
    read_mesh(&path).unwrap_or_else(|error| panic!("{error}"))
}

pub fn area(mesh: &Mesh) -> f32 {
    (0..mesh.triangles.len()).map(|triangle| 0.5 * mesh.area_vector(triangle).length()).sum()
}

pub fn has(findings: &[Finding], code: &str) -> bool {
    findings.iter().any(|finding| finding.code == code)
}

/// A triangle of area 0.5, vertices only.
const POINTS: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

#[test]
fn obj_of_any_program_is_the_same_triangle() {
    let cases: [(&str, String, &str); 16] = [
        ("plain", format!("{POINTS}f 1 2 3\n"), ""),
        ("lines and points", format!("{POINTS}v 5 5 5\nf 1 2 3\nl 1 2 4 3\np 1 2 3 4\n"), "mesh-lines-dropped"),
        ("byte order mark", format!("\u{feff}v 9 9 9\n{POINTS}f 2 3 4\n"), ""),
        ("only carriage returns", format!("{POINTS}f 1 2 3\n").replace('\n', "\r"), ""),
        ("continued", format!("{POINTS}f 1 2 \\\n 3\n"), ""),
        ("comments", format!("{POINTS}f 1 2 3 # ground\n#f 1 2 1 \\\n"), ""),
        ("colours", "v 0 0 0 1 0 0 1\nv 1 0 0 1 0 0 1\nv 0 1 0 .5 0 0 1\nf 1 2 3".into(), ""),
        ("rgb", "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 .5 0 0\nf 1 2 3".into(), ""),
        ("weights", "v 0 0 0 .5\nv .5 0 0 .5\nv 0 .5 0 .5\nf 1 2 3".into(), "mesh-vertices-weighted"),
        ("no material", format!("{POINTS}usemtl\nf 1 2 3\n"), ""),
        ("an unused vertex", format!("{POINTS}v -nan(ind) -nan(ind) 1.#QNAN\nf 1 2 3\n"), "mesh-vertices-dropped"),
        ("bad normals", format!("{POINTS}vn nan 0 0\nvn x\nf 1//1 2//1 3//2\n"), "mesh-normals-dropped"),
        ("bad texture", format!("{POINTS}vt 0 x\nvt\nvt 0 0\nf 1/1 2/2 3/9\n"), "mesh-uvs-dropped"),
        ("small faces", format!("{POINTS}f 1 2\nf 1\nf\nf 1 2 3\n"), "mesh-faces-dropped"),
        ("decimal commas", "v 0,0 0 0\nv 1,0 0,0 0\nv ,0 1, 0\nf 1 2 3".into(), "decimal-commas"),
        ("numbers without digits", "v .0 0. -.0\nv 1. 0 0\nv 0 +1 0e5\nf -3 -2 -1".into(), ""),
    ];
    for (name, content, code) in cases {
        let (mesh, findings) = read("a.obj", content);
        assert_eq!(mesh.triangles.len(), 1, "{name}");
        assert_eq!(mesh.positions.len(), 3, "{name}");
        assert!((area(&mesh) - 0.5).abs() < 1e-6, "{name}: area {}", area(&mesh));
        assert!(code.is_empty() || has(&findings, code), "{name}: {findings:?}");
        assert!(!code.is_empty() || findings.iter().all(|f| f.code == "mesh-normals-computed"), "{name}: {findings:?}");
    }
    // Latin-1 in a comment, as Windows programs write it.
    let mut latin = b"# Stra\xdfe\n".to_vec();
    latin.extend(format!("{POINTS}f 1 2 3\n").bytes());
    assert_eq!(read("a.obj", latin).0.triangles.len(), 1);
}

#[test]
fn what_is_left_out_is_counted_with_its_first_line() {
    let (_, findings) = read("a.obj", format!("{POINTS}f 1 2\nf 3 1\nf 1 2 3\n"));
    let dropped = findings.iter().find(|finding| finding.code == "mesh-faces-dropped").unwrap();
    assert!(dropped.message.starts_with("2 faces"), "{dropped}");
    assert!(matches!(&dropped.target, Place::Line(_, 4)), "{dropped}");
}

#[test]
fn a_concave_face_is_the_same_surface_whatever_its_first_corner() {
    // An L of area 6 in a sloping plane.
    let ell = [(0, 0), (4, 0), (4, 1), (1, 1), (1, 3), (0, 3)];
    let points: String = ell.iter().map(|(x, y)| format!("v {x} {} {y}\n", 0.5 * f64::from(*x))).collect();
    let mut surfaces = Vec::new();
    for start in 0..6 {
        let corners: Vec<String> = (0..6).map(|step| ((start + step) % 6 + 1).to_string()).collect();
        let (mesh, _) = read("a.obj", format!("{points}f {}\n", corners.join(" ")));
        assert!((area(&mesh) - 6.0 * 1.25f32.sqrt()).abs() < 1e-5, "start {start}: {}", area(&mesh));
        let mut triangles: Vec<Vec<[u32; 3]>> = (0..mesh.triangles.len())
            .map(|triangle| {
                let mut corners: Vec<_> =
                    mesh.corners(triangle).iter().map(|corner| corner.to_array().map(f32::to_bits)).collect();
                corners.sort_unstable();
                corners
            })
            .collect();
        triangles.sort_unstable();
        surfaces.push(triangles);
    }
    assert!(surfaces.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn copies_of_faces_go_whichever_way_they_are_wound() {
    let tetrahedron = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
    let faces = ["1 3 2", "1 2 4", "2 3 4", "1 4 3"];
    let twice: String =
        faces.iter().map(|face| format!("f {face}\nf {}\n", face.chars().rev().collect::<String>())).collect();
    let (mesh, findings) = read("a.obj", format!("{tetrahedron}{twice}"));
    assert_eq!(mesh.triangles.len(), 4);
    let told = findings.iter().find(|finding| finding.code == "mesh-copies").unwrap();
    assert!(told.message.starts_with("4 triangles") && told.message.contains("4 of them flipped"), "{told}");
    // The first of each stays: outwards.
    let centre = Vec3::splat(0.25);
    assert!((0..4).all(|triangle| mesh.area_vector(triangle).dot(mesh.corners(triangle)[0] - centre) > 0.0));
}

fn ply(properties: &str, body: &str, faces: usize) -> String {
    let vertices = body.lines().count() - faces;
    format!(
        "ply\nformat ascii 1.0\ncomment VCGLIB generated\nelement vertex {vertices}\n{properties}element face {faces}\n\
         property list uchar int vertex_indices\nend_header\n{body}"
    )
}

#[test]
fn ply_of_any_program_is_the_same_triangle() {
    const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";
    let named = format!("{XYZ}property float scalar_Illuminance_(PCV)\nproperty float scalar_Illuminance_[PCV]\n");
    let cases = [
        ("plain", ply(XYZ, "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", 1), ""),
        ("short numbers", ply(XYZ, "0. .0 -.0\n1. 0 0\n0 1. 0\n3 0 1 2\n", 1), ""),
        ("names", ply(&named, "0 0 0 1 1\n1 0 0 nan 1\n0 1 0 1 inf\n3 0 1 2\n", 1), ""),
        ("small faces", ply(XYZ, "0 0 0\n1 0 0\n0 1 0\n2 0 1\n3 0 1 2\n0\n", 3), "mesh-faces-dropped"),
        ("an unused vertex", ply(XYZ, "0 0 0\n1 0 0\n0 1 0\nnan nan nan\n3 0 1 2\n", 1), "mesh-vertices-dropped"),
        ("windows", ply(XYZ, "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", 1).replace('\n', "\r\n"), ""),
        ("old macintosh", ply(XYZ, "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", 1).replace('\n', "\r"), ""),
        ("commas", ply(XYZ, "0,0 0 0\n1,0 0 0\n0 1,0 0\n3 0 1 2\n", 1), ""),
    ];
    for (name, content, code) in cases {
        let (mesh, findings) = read("a.ply", content);
        assert_eq!(mesh.triangles.len(), 1, "{name}");
        assert!((area(&mesh) - 0.5).abs() < 1e-6, "{name}: area {}", area(&mesh));
        assert!(code.is_empty() || has(&findings, code), "{name}: {findings:?}");
    }
}

#[test]
fn binary_ply_with_odd_names_and_an_unused_vertex_is_read() {
    let mut content = b"ply\r\nformat binary_little_endian 1.0\r\nelement vertex 4\r\nproperty float x\r\nproperty float y\r\n\
        property float z\r\nproperty uchar a (b)\r\nelement face 2\r\nproperty list uchar uint vertex_indices\r\nend_header\r\n"
        .to_vec();
    for (point, extra) in [([0.0, 0.0, 0.0], 1u8), ([1.0, 0.0, 0.0], 2), ([0.0, 1.0, 0.0], 3), ([f32::NAN; 3], 4)] {
        content.extend(point.iter().flat_map(|number: &f32| number.to_le_bytes()));
        content.push(extra);
    }
    for face in [&[0u32, 1][..], &[0, 1, 2]] {
        content.push(face.len() as u8);
        content.extend(face.iter().flat_map(|corner| corner.to_le_bytes()));
    }
    let (mesh, findings) = read("a.ply", content);
    assert_eq!((mesh.triangles.len(), area(&mesh)), (1, 0.5));
    assert!(has(&findings, "mesh-faces-dropped") && has(&findings, "mesh-vertices-dropped"));
}

#[test]
fn survey_coordinates_keep_their_shape_whatever_one_vertex_says() {
    // A millimetre grid at UTM coordinates, with an unused vertex at the origin of the survey.
    let (east, north) = (500_000.0, 5_400_000.0);
    let mut points = String::from("v 0 0 0\n");
    let mut faces = String::new();
    for row in 0..6 {
        for column in 0..6 {
            points += &format!("v {:.4} {:.4} 120\n", east + 0.001 * f64::from(column), north + 0.001 * f64::from(row));
            if row < 5 && column < 5 {
                let v = row * 6 + column + 2;
                faces += &format!("f {v} {} {} {}\n", v + 1, v + 7, v + 6);
            }
        }
    }
    for faces in [faces.clone(), format!("{faces}f 1 2 3\n")] {
        let used = faces.contains("f 1 ");
        let (mesh, findings) = read("a.obj", format!("{points}{faces}"));
        assert_eq!(has(&findings, "mesh-outlier"), used, "{findings:?}");
        assert_eq!(mesh.triangles.len(), 50);
        assert!((area(&mesh) - 25e-6).abs() < 1e-9, "{}", area(&mesh));
        let (low, high) = mesh.bounds().unwrap();
        assert!((high - low).length() < 0.01);
    }
}

#[test]
fn stl_is_read_in_both_forms() {
    let ascii = "solid a\nfacet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1. 0 0\n  vertex 0 1 0\n endloop\nendfacet\n\
        facet normal 0 0 1\n outer loop\n  vertex 1 0 0\n  vertex 1 1 0\n  vertex 0 1 0\n endloop\nendfacet\nendsolid\n";
    let mut binary = b"solid but binary".to_vec();
    binary.resize(80, b' ');
    binary.extend(2u32.to_le_bytes());
    for triangle in [[[0f32, 0., 0.], [1., 0., 0.], [0., 1., 0.]], [[1., 0., 0.], [1., 1., 0.], [0., 1., 0.]]] {
        binary.extend([0; 12]);
        binary.extend(triangle.iter().flatten().flat_map(|number| number.to_le_bytes()));
        binary.extend([0; 2]);
    }
    let trailing = [binary.clone(), b"\n\n".to_vec()].concat();
    let texts = [ascii.to_owned(), ascii.replace('\n', "\r\n"), ascii.to_uppercase()].map(String::into_bytes);
    for content in texts.into_iter().chain([binary.clone(), trailing.clone()]) {
        let (mesh, _) = read("a.stl", content);
        assert_eq!((mesh.triangles.len(), mesh.positions.len(), area(&mesh)), (2, 4, 1.0));
    }
    let told = |content: Vec<u8>| read("a.stl", content).1.iter().any(|finding| finding.code == "stl-trailing-bytes");
    assert!(told(trailing) && !told(binary.clone()));
    let (_keep, folder) = folder();
    std::fs::write(folder.join("a.stl"), &binary[..binary.len() - 1]).unwrap();
    let error = read_mesh(&folder.join("a.stl")).unwrap_err();
    assert!(error.to_string().contains("cut short") || error.kind() == patina::ErrorKind::Malformed, "{error}");
}

/// A scene of the cases beside the repository, or `None` after a printed word.
fn case(name: &str, file: &str) -> Option<std::path::PathBuf> {
    let cases = std::env::var_os("PATINA_CASES")?;
    let path = Path::new(&cases).join(name).join("textured_mesh").join(file);
    path.is_file().then_some(path)
}

#[test]
fn cases_that_were_read_wrongly_have_their_one_triangle() {
    for (name, file) in [
        ("tri", "mesh.obj"),
        ("tri_l4", "mesh.obj"),
        ("tri_bom", "mesh.obj"),
        ("tri_cont", "mesh.obj"),
        ("tri_comment", "mesh.obj"),
        ("tri_rgba", "mesh.obj"),
        ("tri_usemtl", "mesh.obj"),
        ("tri_nanind", "mesh.obj"),
        ("ply_face2", "mesh.ply"),
        ("ply_dot", "mesh.ply"),
        ("ply_paren", "mesh.ply"),
    ] {
        let Some(path) = case(name, file) else {
            println!("skipped: set PATINA_CASES to the folder of the unpacked cases");
            return;
        };
        let (mesh, _) = read_mesh(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((mesh.triangles.len(), mesh.positions.len()), (1, 3), "{name}");
        assert!((area(&mesh) - 18.0).abs() < 1e-4, "{name}: {}", area(&mesh));
    }
}
