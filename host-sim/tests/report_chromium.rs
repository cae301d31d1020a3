//! The report in a browser: it renders, its script runs without complaint, no plot is empty, and it can be printed.

mod support;

use std::path::{Path, PathBuf};
use std::process::Command;

use support::{Folder, host_sim};

/// The browser under the names that distributions give it.
fn chromium() -> Option<PathBuf> {
    let folders = std::env::var_os("PATH")?;
    let names = ["chromium", "chromium-browser", "google-chrome"];
    std::env::split_paths(&folders).flat_map(|f| names.map(|n| f.join(n))).find(|p| p.is_file())
}

fn report(folder: &Folder) -> PathBuf {
    let out = folder.path("report.html");
    let words = [
        "report",
        "--bench",
        "tests/data/bench_45.csv",
        "--machine",
        "host-sim/machines/reference.toml",
        "--out",
    ];
    let output = host_sim(words.into_iter().chain([out.to_str().unwrap()]));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    out
}

/// Runs the browser on a page; returns what it prints and what it logs.
fn browse(browser: &Path, profile: &Path, page: &Path, what: &[&str]) -> (String, String) {
    let fixed = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--enable-logging=stderr",
        "--virtual-time-budget=2000",
    ];
    let output = Command::new(browser)
        .args(fixed)
        .arg(format!("--user-data-dir={}", profile.display()))
        .args(what)
        .arg(format!("file://{}", page.display()))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    (
        String::from_utf8_lossy(&output.stdout).into_owned(),
        String::from_utf8_lossy(&output.stderr).into_owned(),
    )
}

#[test]
fn report_is_one_file_without_network() {
    let folder = Folder::new();
    let html = std::fs::read_to_string(report(&folder)).unwrap();
    for outside in ["http://", "https://", "src=", "@import", "url("] {
        assert!(!html.contains(outside), "{outside}");
    }
    assert!(!html.contains("NaN") && !html.contains("inf,"));
    for wanted in [
        "fig. 8",
        "fig. 12",
        "fig. 13",
        "fig. 14",
        "fig. 16",
        "Residuals",
        "What to measure next",
        "law, joint",
    ] {
        assert!(html.contains(wanted), "{wanted}");
    }
}

#[test]
fn report_renders_in_a_browser_without_a_complaint_and_prints() {
    let Some(browser) = chromium() else {
        eprintln!(
            "SKIPPED: report_renders_in_a_browser: no chromium on this machine (Debian: apt-get install chromium)"
        );
        println!("SKIPPED: report_renders_in_a_browser: no chromium on this machine");
        return;
    };
    let folder = Folder::new();
    let page = report(&folder);
    let (dom, log) = browse(&browser, &folder.path("profile"), &page, &["--dump-dom"]);
    assert!(!log.contains("CONSOLE"), "{log}");
    // The script's last statement counts the points that were drawn: nothing before it failed.
    let ready: usize = dom.split("data-ready=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap();
    println!("{ready} points drawn");
    let figures: Vec<&str> = dom.split("<figure>").skip(1).collect();
    assert_eq!(figures.len(), 10);
    for figure in figures {
        let drawn = figure.split("</figure>").next().unwrap().matches("<circle").count();
        assert!(drawn >= 9, "{drawn} points in {}", &figure[..80]);
    }
    assert!(ready > 10 * 9);
    let pdf = folder.path("report.pdf");
    let print = format!("--print-to-pdf={}", pdf.display());
    browse(&browser, &folder.path("profile"), &page, &[&print]);
    let bytes = std::fs::read(pdf).unwrap();
    let pages = bytes.windows(11).filter(|w| w == b"/Type /Page").count();
    // The catalogue of pages counts once more.
    println!("{} bytes, {pages} page objects", bytes.len());
    assert!(bytes.starts_with(b"%PDF") && bytes.len() > 20_000 && pages >= 3);
    // Proof that the test can fail: a page whose script throws is distinguished from a good one.
    let broken = folder.write(
        "broken.html",
        std::fs::read_to_string(&page).unwrap().replace("\"use strict\";", "\"use strict\"; missing();"),
    );
    let (dom, log) = browse(&browser, &folder.path("profile"), &broken, &["--dump-dom"]);
    assert!(!dom.contains("data-ready") && log.contains("CONSOLE"), "{log}");
}
