//! The main job, end to end: calibrate from bench points, replay a log on the host and in firmware, compare every bit.

use anyhow::{Result, ensure};

use crate::folders::out_dir;
use crate::host_sim::{HostSim, LOG, number};
use crate::workspace::Workspace;
use crate::{firmware, setup};

/// Runs it and prints a summary.
pub fn run() -> Result<()> {
    setup::run()?;
    let workspace = Workspace::load()?;
    firmware::build_for_qemu(&workspace)?;
    let host_sim = HostSim::release(&workspace)?;
    let out = out_dir("demo")?;
    let (calibration, estimates, plot) =
        (out.join("calibration.toml"), out.join("estimates.csv"), out.join("estimates.svg"));
    let page = out.join("report.html");

    let law = host_sim.identify(&calibration)?;
    let proof = host_sim.verify(&calibration)?;
    let host = host_sim.replay(&calibration, &estimates, &plot)?;
    let target = host_sim.pil(&calibration)?;
    host_sim.report(&page)?;

    let samples = number(&target, "samples")?;
    let mismatches = number(&target, "mismatches")?;
    ensure!(samples > 0.0, "no sample of {LOG} reached the firmware");
    ensure!(mismatches == 0.0, "{mismatches} of {samples} estimates differ between host and firmware");

    let points = law["points"].as_array().map_or(0, Vec::len);
    let dropped = law["dropped_terms"].as_array().map_or(0, Vec::len);
    let rejected: f64 = match &host["rejected"] {
        serde_json::Value::Object(by_reason) => {
            by_reason.values().filter_map(serde_json::Value::as_f64).sum()
        }
        other => other.as_f64().unwrap_or(0.0),
    };
    println!();
    println!("Identified   a leakage law from {points} bench points, {dropped} terms dropped;");
    println!(
        "             it predicts their speed ratio to {:.4} % on average",
        number(&law, "ratio_error_mean_pct")?
    );
    println!(
        "             Pump displacement corrected by {:+.2} %, found together with the law",
        100.0 * (number(&law, "displacement_factor")? - 1.0)
    );
    println!(
        "Verified     the controller's code against the lumped model at {} points: ratio {:.1e} mean,",
        number(&proof, "points")?,
        number(&proof, "ratio_error_mean")?
    );
    println!(
        "             {:.1e} worst; Kou {:.2} % mean",
        number(&proof, "ratio_error_max")?,
        number(&proof, "kou_error_mean_pct")?
    );
    println!(
        "Replayed     {} samples on the host at {:.0} samples/s, {rejected} rejected;",
        number(&host, "samples")?,
        number(&host, "samples_per_s")?
    );
    println!(
        "             mean Kou observed {:.5} (L/min)/MPa, error of the predicted ratio {:.2e} mean, {:.2e} worst",
        number(&host, "kou_mean")?,
        number(&host, "ratio_error_mean")?,
        number(&host, "ratio_error_max")?
    );
    println!(
        "In firmware  {samples} samples on an emulated Cortex-M4F at {:.0} samples/s: EVERY BIT AGREES",
        number(&target, "firmware_samples_per_s")?
    );
    println!();
    println!("Calibration  {}", calibration.display());
    println!("Estimates    {}", estimates.display());
    println!("Picture      {}", plot.display());
    println!("Report       {}", page.display());
    Ok(())
}
