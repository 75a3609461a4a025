//! What the terminal says of a fit that has ended.

use crate::export::RunFolder;
use crate::insight::report::data::ReportData;
use crate::job::budget::ENDED_BY_BUDGET;

/// Findings that are repeated when a fit has ended.
const SPOILS_ALL: [&str; 12] = [
    ENDED_BY_BUDGET,
    "intrinsics-scaled",
    "light-differs",
    "light-in-groups",
    "light-turns-with-camera",
    "photo-misplaced",
    "photo-turned",
    "photos-disagree",
    "photos-exchanged",
    "photos-identical",
    "photos-not-explained",
    "photos-shifted",
];

/// Prints the scores and where to look.
pub(super) fn summarise(data: &ReportData, folder: &RunFolder) {
    for aggregate in &data.aggregates {
        let (raw, aligned) = (&aggregate.score.raw, &aggregate.score.aligned);
        println!(
            "{:15} {} views: PSNR {:.2} dB, SSIM {:.3}, RMSE {:.4} (scale-aligned: {:.2} dB, {:.3}, {:.4})",
            aggregate.name,
            aggregate.score.views,
            raw.psnr_srgb_db,
            raw.ssim_srgb,
            raw.rmse_linear,
            aligned.psnr_srgb_db,
            aligned.ssim_srgb,
            aligned.rmse_linear
        );
    }
    // What spoils a fit as a whole is said once more beside its scores.
    for finding in data.findings.iter().filter(|finding| SPOILS_ALL.contains(&finding.code.as_str())) {
        println!("warning [{}]: {} ({})", finding.code, finding.message, finding.remedy);
    }
    if let Some(truth) = &data.truth {
        println!("against the truth, raw (scale-aligned):");
        if let Some(maps) = &truth.maps {
            for (name, pair) in [("diffuse", maps.diffuse), ("specular", maps.specular), ("roughness", maps.roughness)]
            {
                println!("  {name:12} RMSE {:.4} ({:.4})", pair.raw, pair.aligned);
            }
        }
        if let Some(light) = &truth.environment {
            println!(
                "  light        relative L2 {:.3} ({:.3}), log RMSE {:.3} ({:.3})",
                light.relative_l2.raw, light.relative_l2.aligned, light.log_rmse.raw, light.log_rmse.aligned
            );
            if let Some(angle) = light.brightest_angle_degrees {
                println!("  brightest light off by {angle:.1} degrees");
            }
        }
        if let Some(relit) = &truth.relit {
            println!(
                "  relit        RMSE {:.4} ({:.4}), PSNR {:.2} dB ({:.2} dB)",
                relit.raw.rmse_linear, relit.aligned.rmse_linear, relit.raw.psnr_srgb_db, relit.aligned.psnr_srgb_db
            );
        }
    }
    let whole = data.timings.iter().map(|time| format!("{} {:.1} s", time.stage, time.seconds)).collect::<Vec<_>>();
    let total: f64 = data.timings.iter().map(|time| time.seconds).sum();
    println!("{}; together {total:.1} s", whole.join(", "));
    if let Some(bytes) = data.peak_memory_bytes {
        println!("peak memory {}", crate::insight::report::number::memory(bytes));
    }
    println!("report: {}", folder.report_html_path().display());
}
