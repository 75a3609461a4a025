//! Cameras of three photos of 12 x 9 pixels in the words of each program.

use super::{PHOTOS, Target};
use crate::scene::read::numpy;

/// BlendedMVS.
pub const CAM_TXT: &str =
    "extrinsic\n1 0 0 -0.3\n0 1 0 -0.3\n0 0 1 4\n0 0 0 1\n\nintrinsic\n12 0 6\n0 12 4.5\n0 0 1\n\n0.1 0.01 192 5\n";

/// Objects with Lighting: K, R, t, then width, height and channels.
pub const LIGHTING: &str = "12 0 6\n0 12 4.5\n0 0 1\n1 0 0\n0 1 0\n0 0 1\n-0.3 -0.3 4\n1.2e+01 9 3\n";

/// `scene.toml` with the cameras of [`CAMERAS_JSON`].
pub const MANIFEST: &str = "name = \"small\"\nmesh = \"mesh.ply\"\nimages = \"photos\"\ncameras = \"cameras.json\"\ncamera_axes = \"opencv\"\n\
camera_matrix = \"camera_from_world\"\nup = \"Y\"\npixel_centre = \"half\"\nbackground = \"environment\"\nheld_out = [\"b\"]\n";

/// Cameras of a manifest.
pub const CAMERAS_JSON: &str = r#"{"convention":"opencv","views":[
{"file":"a.png","width":12,"height":9,"K":[[12,0,6],[0,12,4.5],[0,0,1]],"w2c":[[1,0,0,-0.3],[0,1,0,-0.3],[0,0,1,4],[0,0,0,1]]},
{"file":"b.png","width":12,"height":9,"K":[[12,0,6],[0,12,4.5],[0,0,1]],"w2c":[[1,0,0,-0.2],[0,1,0,-0.3],[0,0,1,4],[0,0,0,1]]},
{"file":"c.png","K":[[12,0,6],[0,12,4.5],[0,0,1]],"w2c":[[0,0,1,0],[0,1,0,-0.3],[-1,0,0,4],[0,0,0,1]],"held_out":false}]}"#;

/// Cameras of an exchange folder.
pub const EXCHANGE: &str = r#"{"convention":"opencv","views":[
{"file":"views/a.png","width":12,"height":9,"K":[[12,0,6],[0,12,4.5],[0,0,1]],"w2c":[[1,0,0,-0.3],[0,1,0,-0.3],[0,0,1,4],[0,0,0,1]]},
{"file":"views/b.png","width":12,"height":9,"K":[[12,0,6],[0,12,4.5],[0,0,1]],"w2c":[[1,0,0,-0.2],[0,1,0,-0.3],[0,0,1,4],[0,0,0,1]]},
{"file":"views/c.png","width":12,"height":9,"K":[[12,0,6],[0,12,4.5],[0,0,1]],"w2c":[[0,0,1,0],[0,1,0,-0.3],[-1,0,0,4],[0,0,0,1]]}]}"#;

/// COLMAP, text.
pub const COLMAP_CAMERAS: &str = "# Camera list\n1 PINHOLE 12 9 12 12 6 4.5\n2 OPENCV 12 9 12 12 6 4.5 0.1 -0.01 0.001 -0.001\n\
3 THIN_PRISM_FISHEYE 12 9 12 12 6 4.5 0.1 0 0 0 0 0 0 0\n";
/// COLMAP, text.
pub const COLMAP_IMAGES: &str = "# Image list\n1 1 0 0 0 -0.3 -0.3 4 1 a.png\n1.0 2.0 -1 3.0 4.0 7\n2 0.8 0.6 0 0 0 0 4 2 b.png\n\n\
3 1 0 0 0 -0.3 -0.3 5 3 c.png\n\n";

/// COLMAP, binary.
pub fn colmap_cameras() -> Vec<u8> {
    let mut bytes = 2u64.to_le_bytes().to_vec();
    for (id, model, more) in [(1u32, 1u32, &[][..]), (2, 4, &[0.1, -0.01, 0.001, -0.001])] {
        bytes.extend([id.to_le_bytes(), model.to_le_bytes()].concat());
        bytes.extend([12u64.to_le_bytes(), 9u64.to_le_bytes()].concat());
        let parameters = [12.0, 12.0, 6.0, 4.5].iter().chain(more);
        parameters.for_each(|value: &f64| bytes.extend(value.to_le_bytes()));
    }
    bytes
}

/// COLMAP, binary.
pub fn colmap_images() -> Vec<u8> {
    let mut bytes = 3u64.to_le_bytes().to_vec();
    for (id, name) in PHOTOS.iter().enumerate() {
        bytes.extend((id as u32 + 1).to_le_bytes());
        let pose = [1.0, 0.0, 0.0, 0.0, -0.3, -0.3, 4.0 + id as f64];
        pose.iter().for_each(|value: &f64| bytes.extend(value.to_le_bytes()));
        bytes.extend((1 + id as u32 % 2).to_le_bytes());
        bytes.extend(name.as_bytes());
        bytes.push(0);
        bytes.extend(1u64.to_le_bytes());
        bytes.extend([0xff; 24]);
    }
    bytes
}

/// nerfstudio.
pub const TRANSFORMS: &str = r#"{"camera_model":"OPENCV","fl_x":12,"fl_y":12,"cx":6,"cy":4.5,"w":12,"h":9,"k1":0.1,"k2":0,"p1":0.01,"p2":0,
"applied_transform":[[1,0,0,0],[0,0,1,0],[0,-1,0,0]],"applied_scale":1.0,
"frames":[{"file_path":"./a.png","transform_matrix":[[1,0,0,0.3],[0,1,0,0.3],[0,0,1,4],[0,0,0,1]]},
{"file_path":"b","fl_x":13,"transform_matrix":[[1,0,0,0.2],[0,1,0,0.3],[0,0,1,4],[0,0,0,1]]},
{"file_path":"c.png","camera_model":"OPENCV_FISHEYE","transform_matrix":[[1,0,0,0.1],[0,1,0,0.3],[0,0,1,4],[0,0,0,1]]}]}"#;

/// Metashape, exported cameras.
pub const METASHAPE_XML: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<document version="1.5.0"><chunk label="Chunk 1" enabled="1"><sensors>
<sensor id="0" type="frame"><resolution width="12" height="9"/><calibration type="frame" class="adjusted"><resolution width="12" height="9"/>
<f>12</f><cx>0.5</cx><cy>-0.25</cy><b1>1</b1><b2>0.5</b2><k1>0.1</k1><p1>0.001</p1><p2>0.002</p2></calibration></sensor>
<sensor id="1" type="fisheye"><resolution width="12" height="9"/><calibration type="fisheye" class="adjusted"><f>8</f></calibration></sensor>
<sensor id="2" type="frame" master_id="0"><resolution width="12" height="9"/><calibration type="frame" class="adjusted"><f>12</f></calibration>
<rotation fixed="true">1 0 0 0 1 0 0 0 1</rotation><location fixed="false">0.1 0 0.05</location></sensor></sensors>
<cameras><camera id="0" sensor_id="0" label="a"><transform>1 0 0 0.3 0 -1 0 0.3 0 0 -1 4 0 0 0 1</transform></camera>
<group label="g"><camera id="1" sensor_id="1" label="b.png"><transform>1 0 0 0.2 0 -1 0 0.3 0 0 -1 4 0 0 0 1</transform></camera></group>
<camera id="2" sensor_id="2" master_id="0" label="c"/><camera id="3" sensor_id="0" label="d"/></cameras>
<transform><rotation>0 -1 0 1 0 0 0 0 1</rotation><translation>1 2 3</translation><scale>2</scale></transform></chunk></document>"#;

/// Metashape, a chunk of a project.
pub const METASHAPE_CHUNK: &str = r#"<chunk label="Chunk 1"><sensors><sensor id="0" type="frame"><resolution width="12" height="9"/>
<calibration type="frame" class="adjusted"><fx>12</fx><fy>12</fy><cx>6</cx><cy>4.5</cy><k1>0.1</k1></calibration></sensor></sensors>
<cameras><camera id="7" label="a" sensor_id="0"><transform>1 0 0 0.3 0 -1 0 0.3 0 0 -1 4 0 0 0 1</transform></camera>
<camera id="8" label="b" sensor_id="0"><transform>1 0 0 0.2 0 -1 0 0.3 0 0 -1 4 0 0 0 1</transform></camera></cameras>
<frames><frame id="0" path="0/frame.zip"/></frames></chunk>"#;

/// Metashape, the files of a project; those that end in `.zip` are the documents to be packed.
pub fn metashape_project() -> Vec<Target> {
    let target =
        |path: &str, text: &str| Target { path: path.into(), whole: text.into(), wrap: |bytes| bytes.to_vec() };
    vec![
        target("p.psx", r#"<document version="1.2.0" path="{projectname}.files/project.zip"/>"#),
        target(
            "p.files/project.zip",
            r#"<document version="1.2.0"><chunks><chunk id="0" path="0/chunk.zip"/></chunks></document>"#,
        ),
        target("p.files/0/chunk.zip", METASHAPE_CHUNK),
        target(
            "p.files/0/0/frame.zip",
            r#"<frame><cameras><camera camera_id="7"><photo path="../a.png"/></camera><camera camera_id="8"><photo path="b.png"/>
</camera></cameras><masks path="masks/masks.zip"/></frame>"#,
        ),
    ]
}

/// RealityCapture, a side file.
pub const XMP: &str = r#"<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description xcr:Version="3" xcr:DistortionModel="brown4t2" xcr:FocalLength35mm="36" xcr:PrincipalPointU="0.01"
xcr:PrincipalPointV="-0.02" xcr:InTexturing="1" xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#">
<xcr:Rotation>1 0 0 0 1 0 0 0 1</xcr:Rotation><xcr:Position>0.3 0.3 -4</xcr:Position>
<xcr:DistortionCoeficients>0.1 0.02 0 0.001 0 0</xcr:DistortionCoeficients></rdf:Description></rdf:RDF></x:xmpmeta>"#;

/// RealityCapture, a table.
pub const CSV: &str = "#cameras 3\n#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n\
a.png,0.3,0.3,4,0,0,0,36,0.1,0.1,0.1,0,0,0,0,0\n\"b.png\",0.2,0.3,4,0,0,0,36,0,0,0,0,0,0,0,0\nc.png,0.1,0.3,4,0,5,0,36,0,0,0,0,0,0,0,0\n";

/// Bundler.
pub fn bundle() -> String {
    let camera = |x: f64| format!("12 0.1 -0.02\n1 0 0\n0 1 0\n0 0 1\n{x} -0.3 -4\n");
    format!("# Bundle file v0.3\n3 0\n{}{}{}", camera(-0.3), camera(-0.2), camera(-0.1))
}

/// OpenMVS.
pub fn openmvs() -> Vec<u8> {
    const SAME: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let mut bytes = b"MVSI\x06\0\0\0\0\0\0\0".to_vec();
    let count = |bytes: &mut Vec<u8>, value: usize| bytes.extend((value as u64).to_le_bytes());
    let name = |bytes: &mut Vec<u8>, text: &str| {
        bytes.extend((text.len() as u64).to_le_bytes());
        bytes.extend(text.as_bytes());
    };
    let doubles = |bytes: &mut Vec<u8>, values: &[f64]| values.iter().for_each(|own| bytes.extend(own.to_le_bytes()));
    count(&mut bytes, 1);
    name(&mut bytes, "platform");
    count(&mut bytes, 1);
    name(&mut bytes, "camera");
    name(&mut bytes, "RGB");
    bytes.extend([0; 8]);
    doubles(&mut bytes, &[1.0, 0.0, 0.45, 0.0, 1.0, 0.33, 0.0, 0.0, 1.0]);
    doubles(&mut bytes, &SAME);
    doubles(&mut bytes, &[0.0; 3]);
    count(&mut bytes, PHOTOS.len());
    for pose in 0..PHOTOS.len() {
        doubles(&mut bytes, &SAME);
        doubles(&mut bytes, &[0.1 * pose as f64, 0.3, -4.0]);
    }
    count(&mut bytes, PHOTOS.len());
    for (pose, photo) in PHOTOS.iter().enumerate() {
        name(&mut bytes, photo);
        name(&mut bytes, "");
        [0, 0, pose as u32, pose as u32].iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    }
    bytes
}

/// OpenSfM.
pub const OPENSFM: &str = r#"[{"cameras":{"c":{"projection_type":"brown","width":12,"height":9,"focal_x":1.0,"focal_y":1.0,
"c_x":0.01,"c_y":-0.02,"k1":0.1,"k2":0.02,"k3":0,"p1":0.001,"p2":0.002}},
"shots":{"a.png":{"rotation":[0,0,0.1],"translation":[-0.3,-0.3,4],"camera":"c"},
"b.png":{"rotation":[0,0.1,0],"translation":[-0.2,-0.3,4],"camera":"c"}}},{"cameras":{},"shots":{}}]"#;

/// AliceVision.
pub const ALICEVISION: &str = r#"{"views":[{"viewId":"1","poseId":"1","intrinsicId":"5","path":"/far/a.png"},{"viewId":"2","poseId":"2",
"intrinsicId":"5","path":"/far/b.png"}],"intrinsics":[{"intrinsicId":"5","width":"12","height":"9",
"pxFocalLength":["12","12"],"principalPoint":["0.5","-0.25"],"type":"radial3","distortionParams":["0.1","0","0.01"]}],
"poses":[{"poseId":"1","pose":{"transform":{"rotation":["1","0","0","0","1","0","0","0","1"],"center":["0.3","0.3","-4"]}}},
{"poseId":"2","pose":{"transform":{"rotation":["1","0","0","0","1","0","0","0","1"],"center":["0.2","0.3","-4"]}}}]}"#;

/// NeuS: a camera matrix, packed under the names of all.
pub fn neus_target() -> Target {
    let world = [12.0, 0.0, 6.0, 20.4, 0.0, 12.0, 4.5, 14.4, 0.0, 0.0, 1.0, 4.0, 0.0, 0.0, 0.0, 1.0];
    Target { path: "cameras_sphere.npz".into(), whole: numpy::written(&[4, 4], &world), wrap: |bytes| bytes.to_vec() }
}

/// LLFF: three rows of a camera at a distance of 4.
pub fn llff_rows() -> Vec<f64> {
    let row = [0.0, 1.0, 0.0, 0.3, 9.0, -1.0, 0.0, 0.0, 0.3, 12.0, 0.0, 0.0, 1.0, 4.0, 12.0, 0.1, 9.0];
    [row, row, row].concat()
}
