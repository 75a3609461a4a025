use super::report::AuditReport;
use super::*;
use crate::material::Material;
use crate::render::Parameters;

#[test]
fn a_wrong_derivative_is_found_and_named() {
    let settings = AuditSettings { consistency_parameters: 0, parameters: 40, ..AuditSettings::default() };
    let rows = |factor: f64| -> Vec<report::Difference> {
        (0..40)
            .map(|index| {
                let parameter = if index % 2 == 0 {
                    readers::Parameter::Texel { index, number: index % 7 }
                } else {
                    readers::Parameter::Light { index, channel: index % 3 }
                };
                let difference = 1.0 + index as f64;
                let precise = difference * if index == 12 { factor } else { 1.0 };
                report::Difference { parameter, places: [false; 6], difference, precise, single: difference }
            })
            .collect()
    };
    let weights = crate::material::texels::PyramidWeights::flat(8, 8);
    let parameters = Parameters {
        texels: crate::material::TexelPyramid::from_base(vec![Material::default(); 64], &weights),
        light: vec![[0.0; 3]; 64],
        environment_size: (16, 4),
    };
    let report = |factor: f64| {
        let mut report = AuditReport { settings, ..AuditReport::default() };
        report.add_gradient(rows(factor), &parameters);
        report
    };
    assert!(report(1.0).passes());
    let failed = report(1.01);
    assert!(!failed.passes());
    // Texel 12, number 5, on a map 8 texels wide.
    assert_eq!(failed.worst[0].parameter, "specular B at (1, 4)");
    assert!(failed.to_markdown().contains("FAILS") && failed.to_markdown().contains("specular B at (1, 4)"));
    assert!(!report(f64::NAN).passes());
}
