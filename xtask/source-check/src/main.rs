//! Static checks of the workspace's sources: dependency arrows, import circles, type names and terms.
//!
//! Called by `cargo xtask arrows`, `docs` and `names`, and by `cargo xtask test`.

mod arrows;
mod docs;
mod files;
mod module_tree;
mod names;
mod packages;

use std::process::ExitCode;

use anyhow::{Result, bail};

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    match run(&args) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &[&str]) -> Result<ExitCode> {
    let (complaints, summary) = match args {
        ["arrows"] => arrows::check_workspace()?,
        ["docs"] => docs::check_workspace()?,
        ["names"] => names::check_workspace()?,
        other => bail!("`{}` is none of `arrows`, `docs`, `names`", other.join(" ")),
    };
    for complaint in &complaints {
        eprintln!("error: {complaint}\n");
    }
    println!("{summary}; {} complaints", complaints.len());
    Ok(if complaints.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
