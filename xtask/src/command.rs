//! Running other programs: shown before they start, bounded in time where they could hang, errors that name them.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use crate::workspace::root;

/// A program to run, in the workspace's root unless told otherwise.
#[derive(Debug)]
pub struct Run {
    command: Command,
    quiet: bool,
}

/// What a program that was watched has said.
#[derive(Debug)]
pub struct Output {
    /// How it ended.
    pub status: ExitStatus,
    /// Its standard output.
    pub stdout: String,
    /// Its standard error.
    pub stderr: String,
}

impl Run {
    /// A build whose output is watched is given up after this.
    pub const BUILD_LIMIT: Duration = Duration::from_secs(900);

    /// A program with its first arguments.
    pub fn new(program: impl AsRef<OsStr>, words: &[&str]) -> Self {
        let mut command = Command::new(program);
        command.args(words).current_dir(root()).stdin(Stdio::null());
        Self { command, quiet: false }
    }

    /// The cargo that runs xtask.
    pub fn cargo(words: &[&str]) -> Self {
        Self::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()), words)
    }

    /// Further arguments.
    pub fn args<S: AsRef<OsStr>>(mut self, words: impl IntoIterator<Item = S>) -> Self {
        self.command.args(words);
        self
    }

    /// Another working directory. Cargo takes the settings of `.cargo/config.toml` from there.
    pub fn dir(mut self, dir: &Path) -> Self {
        self.command.current_dir(dir);
        self
    }

    /// An environment variable.
    pub fn env(mut self, key: &str, value: &str) -> Self {
        self.command.env(key, value);
        self
    }

    /// Does not show the command line.
    pub fn quiet(mut self) -> Self {
        self.quiet = true;
        self
    }

    /// The command line as a person would type it.
    pub fn line(&self) -> String {
        let program = Path::new(self.command.get_program()).file_name().unwrap_or_default();
        let mut words = vec![program.to_string_lossy()];
        words.extend(self.command.get_args().map(OsStr::to_string_lossy));
        let words = words.join(" ");
        match self.command.get_current_dir().and_then(|dir| dir.strip_prefix(root()).ok()) {
            Some(dir) if dir != Path::new("") => format!("(cd {}; {words})", dir.display()),
            _ => words,
        }
    }

    fn spawn(&mut self) -> Result<Child> {
        if !self.quiet {
            eprintln!("$ {}", self.line());
        }
        let program = self.command.get_program().to_string_lossy().into_owned();
        self.command.spawn().with_context(|| format!("starting `{program}`"))
    }

    /// Runs it with our own output; true when it succeeded.
    pub fn succeeds(mut self) -> Result<bool> {
        Ok(self.spawn()?.wait()?.success())
    }

    /// Runs it with our own output and demands success.
    pub fn check(mut self) -> Result<()> {
        let status = self.spawn()?.wait()?;
        if status.success() { Ok(()) } else { bail!("`{}` failed ({status})", self.line()) }
    }

    /// Runs it, hands every line of its standard output to `each` as it comes, and returns how it ended.
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

    /// Runs it with our own standard error, demands success and returns its standard output.
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

    /// Runs it for at most `limit` and returns all that it said.
    pub fn output_within(mut self, limit: Duration) -> Result<Output> {
        self.command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = self.spawn()?;
        let stdout = child.stdout.take().map(collect);
        let stderr = child.stderr.take().map(collect);
        let started = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait()? {
                break status;
            }
            if started.elapsed() > limit {
                child.kill()?;
                child.wait()?;
                bail!("`{}` did not end within {} s and was stopped", self.line(), limit.as_secs());
            }
            thread::sleep(Duration::from_millis(5));
        };
        Ok(Output { status, stdout: text_of(stdout), stderr: text_of(stderr) })
    }
}

/// Reads a pipe to its end beside the program, which would otherwise block on a full pipe.
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
