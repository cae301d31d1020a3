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
    command: CliCommand,
}

#[derive(Debug, Subcommand)]
enum CliCommand {
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
        CliCommand::Identify(args) => identify::run(&args),
        CliCommand::Replay(args) => replay::run(&args),
        CliCommand::Pil(args) => pil::run(&args),
        CliCommand::Synth(args) => synth::run(&args),
        CliCommand::Verify(args) => verify::run(&args),
        CliCommand::Report(args) => report::run(&args),
        CliCommand::Evaluate(args) => evaluate::run(&args),
        CliCommand::Simulate(args) => simulate::run(&args),
        CliCommand::Step(args) => step::run(&args),
        CliCommand::Paper(args) => paper::run(&args),
        CliCommand::Dbc(args) => dbc::run(&args),
        CliCommand::Update(args) => update::run(&args),
        CliCommand::Provision(args) => provision::run(&args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            failure.exit_code()
        }
    }
}
