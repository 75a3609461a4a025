//! COLMAP's camera models by number and name, with the order of their parameters (`sensor/models.h`).

use crate::error::{Error, ErrorKind, Place, Result};
use crate::scene::lens::{Base, Lens, Model, Polynomial};
use glam::DMat3;

/// Name and number of parameters of each model, at the place of its number.
const MODELS: [(&str, usize); 18] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
    ("SIMPLE_DIVISION", 4),
    ("DIVISION", 5),
    ("SIMPLE_FISHEYE", 3),
    ("FISHEYE", 4),
    ("EUCM", 6),
    ("EQUIRECTANGULAR", 2),
];

fn unknown(what: String, place: &Place) -> Error {
    let known = MODELS[..17].iter().map(|model| model.0).collect::<Vec<_>>().join(", ");
    Error::new(ErrorKind::Unsupported, format!("the camera model {what} is not supported"))
        .at(place.clone())
        .remedy(format!("undistort the photos (COLMAP: image_undistorter), or use one of {known}"))
}

/// Name and number of parameters of a model by its number.
pub fn model_of_id(id: i32, place: &Place) -> Result<(&'static str, usize)> {
    let model = usize::try_from(id).ok().and_then(|id| MODELS.get(id));
    model.copied().ok_or_else(|| unknown(format!("number {id}"), place))
}

/// Name and number of parameters of a model by its name.
pub fn model_of_name(name: &str, place: &Place) -> Result<(&'static str, usize)> {
    MODELS.iter().find(|model| model.0 == name).copied().ok_or_else(|| unknown(name.to_owned(), place))
}

/// Intrinsics and lens of a model's parameters.
///
/// # Errors
/// `Unsupported` for panoramas, `Malformed` for too few parameters.
pub fn lens_of(model: &str, parameters: &[f64], place: &Place) -> Result<(DMat3, Lens)> {
    let (_, count) = model_of_name(model, place)?;
    if parameters.len() != count {
        return Err(Error::new(
            ErrorKind::Malformed,
            format!("{model} has {count} parameters, not {}", parameters.len()),
        )
        .at(place.clone())
        .remedy("export the model again"));
    }
    let has_one_focal_length = matches!(
        model,
        "SIMPLE_PINHOLE"
            | "SIMPLE_RADIAL"
            | "RADIAL"
            | "SIMPLE_RADIAL_FISHEYE"
            | "RADIAL_FISHEYE"
            | "SIMPLE_DIVISION"
            | "SIMPLE_FISHEYE"
    );
    if model == "EQUIRECTANGULAR" {
        return Err(Error::new(ErrorKind::Unsupported, "a panorama of 360 degrees is not a photo of one camera")
            .at(place.clone())
            .remedy("cut it into perspective photos first (COLMAP: panorama_sfm)"));
    }
    let (focal, rest) = if has_one_focal_length {
        ([parameters[0]; 2], &parameters[1..])
    } else {
        ([parameters[0], parameters[1]], &parameters[2..])
    };
    let (centre, k) = ([rest[0], rest[1]], &rest[2..]);
    let radial = |values: &[f64]| {
        let mut numerator = [0.0; 6];
        numerator[..values.len()].copy_from_slice(values);
        numerator
    };
    let polynomial = match model {
        "FOV" => return Ok((matrix(focal, centre), Lens::new(Model::FieldOfView { omega: k[0] }))),
        "SIMPLE_DIVISION" | "DIVISION" => return Ok((matrix(focal, centre), Lens::new(Model::Division { k: k[0] }))),
        "EUCM" => {
            return Ok((matrix(focal, centre), Lens::new(Model::ExtendedUnified { alpha: k[0], beta: k[1] })));
        }
        "SIMPLE_PINHOLE" | "PINHOLE" => Polynomial::default(),
        "SIMPLE_RADIAL" | "RADIAL" => Polynomial { numerator: radial(k), ..Default::default() },
        "OPENCV" => Polynomial { numerator: radial(&k[..2]), tangential: [k[2], k[3]], ..Default::default() },
        "FULL_OPENCV" => Polynomial {
            numerator: radial(&[k[0], k[1], k[4]]),
            tangential: [k[2], k[3]],
            denominator: [k[5], k[6], k[7]],
            ..Default::default()
        },
        "THIN_PRISM_FISHEYE" => Polynomial {
            base: Base::Angle,
            numerator: radial(&[k[0], k[1], k[4], k[5]]),
            tangential: [k[2], k[3]],
            prism_x: [k[6], 0.0],
            prism_y: [k[7], 0.0],
            ..Default::default()
        },
        "RAD_TAN_THIN_PRISM_FISHEYE" => Polynomial {
            base: Base::Angle,
            numerator: radial(&k[..6]),
            // Aria's order of the tangential pair is the other one.
            tangential: [k[7], k[6]],
            prism_x: [k[8], k[9]],
            prism_y: [k[10], k[11]],
            after_radial: true,
            ..Default::default()
        },
        // The fisheyes with radial coefficients alone, or none.
        _ => Polynomial { base: Base::Angle, numerator: radial(k), ..Default::default() },
    };
    Ok((matrix(focal, centre), Lens::new(Model::Polynomial(polynomial))))
}

/// Intrinsics of focal lengths and principal point.
pub fn matrix(focal: [f64; 2], centre: [f64; 2]) -> DMat3 {
    DMat3::from_cols_array(&[focal[0], 0.0, 0.0, 0.0, focal[1], 0.0, centre[0], centre[1], 1.0])
}
