//! Command line of `host-sim`. Exit codes: 0 fine, 1 a check failed, 2 bad input.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use host_sim::commands::{
    Failure, dbc, evaluate, identify, paper, pil, provision, replay, report, simulate, step, synth, update,
    verify,
};

/// Identifies, replays and verifies the leakage estimator of a pump-motor drive.
#[derive(Debug, Parser)]
#[command(version, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Identify(identify::Args),
    Replay(replay::Args),
    Pil(pil::Args),
    Synth(synth::Args),
    Verify(verify::Args),
    Report(report::Args),
    Evaluate(evaluate::Args),
    Simulate(simulate::Args),
    Step(step::Args),
    Paper(paper::Args),
    Dbc(dbc::Args),
    Update(update::Args),
    Provision(provision::Args),
}

#[test]
fn command_line_is_consistent() {
    // clap checks names, groups and values of all commands only when asked, and in debug builds.
    use clap::CommandFactory;
    Cli::command().debug_assert();
}

fn main() -> ExitCode {
    let result: Result<(), Failure> = match Cli::parse().command {
        Command::Identify(args) => identify::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Pil(args) => pil::run(&args),
        Command::Synth(args) => synth::run(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Report(args) => report::run(&args),
        Command::Evaluate(args) => evaluate::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Step(args) => step::run(&args),
        Command::Paper(args) => paper::run(&args),
        Command::Dbc(args) => dbc::run(&args),
        Command::Update(args) => update::run(&args),
        Command::Provision(args) => provision::run(&args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            failure.exit_code()
        }
    }
}
