//! Running other programs: the command line is printed first, the time is bounded where they could hang, errors name them.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use crate::folders::root;

/// A program to run, by default in the workspace's root.
#[derive(Debug)]
pub struct CommandLine {
    command: Command,
    quiet: bool,
}

/// Exit status and output of a program.
#[derive(Debug)]
pub struct CapturedOutput {
    /// Its exit status.
    pub status: ExitStatus,
    /// Its standard output.
    pub stdout: String,
    /// Its standard error.
    pub stderr: String,
}

impl CommandLine {
    /// Time-out of a build whose output is captured.
    pub const BUILD_TIMEOUT: Duration = Duration::from_secs(900);

    /// A program with its first arguments.
    pub fn new(program: impl AsRef<OsStr>, args: &[&str]) -> Self {
        let mut command = Command::new(program);
        command.args(args).current_dir(root()).stdin(Stdio::null());
        Self { command, quiet: false }
    }

    /// The cargo that runs xtask.
    pub fn cargo(args: &[&str]) -> Self {
        Self::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()), args)
    }

    /// Further arguments.
    pub fn args<S: AsRef<OsStr>>(mut self, args: impl IntoIterator<Item = S>) -> Self {
        self.command.args(args);
        self
    }

    /// Another working directory. Cargo reads `.cargo/config.toml` there.
    pub fn dir(mut self, dir: &Path) -> Self {
        self.command.current_dir(dir);
        self
    }

    /// An environment variable.
    pub fn env(mut self, key: &str, value: &str) -> Self {
        self.command.env(key, value);
        self
    }

    /// Does not print the command line.
    pub fn quiet(mut self) -> Self {
        self.quiet = true;
        self
    }

    /// The command line as a person would type it.
    pub fn line(&self) -> String {
        let program = Path::new(self.command.get_program()).file_name().unwrap_or_default();
        let mut args = vec![program.to_string_lossy()];
        args.extend(self.command.get_args().map(OsStr::to_string_lossy));
        let args = args.join(" ");
        match self.command.get_current_dir().and_then(|dir| dir.strip_prefix(root()).ok()) {
            Some(dir) if dir != Path::new("") => format!("(cd {}; {args})", dir.display()),
            _ => args,
        }
    }

    fn spawn(&mut self) -> Result<Child> {
        if !self.quiet {
            eprintln!("$ {}", self.line());
        }
        let program = self.command.get_program().to_string_lossy().into_owned();
        self.command.spawn().with_context(|| format!("starting `{program}`"))
    }

    /// Runs it with inherited output; true when it succeeded.
    pub fn succeeds(mut self) -> Result<bool> {
        Ok(self.spawn()?.wait()?.success())
    }

    /// Runs it with inherited output; an error unless it succeeds.
    pub fn check(mut self) -> Result<()> {
        let status = self.spawn()?.wait()?;
        if status.success() { Ok(()) } else { bail!("`{}` failed ({status})", self.line()) }
    }

    /// Runs it, calls `each` with every line of its standard output as it comes, and returns the exit status.
    pub fn each_line(mut self, mut each: impl FnMut(&str)) -> Result<ExitStatus> {
        self.command.stdout(Stdio::piped());
        let mut child = self.spawn()?;
        if let Some(stdout) = child.stdout.take() {
            let mut reader = BufReader::new(stdout);
            let mut line = Vec::new();
            // By bytes: a test may print what is not UTF-8.
            while reader.read_until(b'\n', &mut line)? > 0 {
                each(String::from_utf8_lossy(&line).trim_end_matches(['\n', '\r']));
                line.clear();
            }
        }
        Ok(child.wait()?)
    }

    /// Runs it with inherited standard error and returns its standard output; an error unless it succeeds.
    pub fn stdout(self) -> Result<String> {
        let line = self.line();
        let mut text = String::new();
        let status = self.each_line(|line| {
            text.push_str(line);
            text.push('\n');
        })?;
        if !status.success() {
            bail!("`{line}` failed ({status})");
        }
        Ok(text)
    }

    /// Runs it for at most `timeout` and returns its output.
    pub fn output_within(mut self, timeout: Duration) -> Result<CapturedOutput> {
        self.command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = self.spawn()?;
        let stdout = child.stdout.take().map(collect);
        let stderr = child.stderr.take().map(collect);
        let started = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait()? {
                break status;
            }
            if started.elapsed() > timeout {
                child.kill()?;
                child.wait()?;
                bail!("`{}` did not end within {} s and was stopped", self.line(), timeout.as_secs());
            }
            thread::sleep(Duration::from_millis(5));
        };
        Ok(CapturedOutput { status, stdout: text_of(stdout), stderr: text_of(stderr) })
    }
}

/// Reads a pipe to its end in a thread of its own: the program would block on a full pipe.
fn collect(mut pipe: impl Read + Send + 'static) -> thread::JoinHandle<Vec<u8>> {
    thread::spawn(move || {
        let mut bytes = Vec::new();
        // What was read before an error is still worth showing.
        drop(pipe.read_to_end(&mut bytes));
        bytes
    })
}

fn text_of(reader: Option<thread::JoinHandle<Vec<u8>>>) -> String {
    let bytes = reader.and_then(|reader| reader.join().ok()).unwrap_or_default();
    String::from_utf8_lossy(&bytes).into_owned()
}
