//! Simulators that are no crates: made and called as programs, where what they need is there.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::Size;

/// A program that is told a size, and prints how long an event took.
pub struct Program {
    command: PathBuf,
    first: Option<PathBuf>,
}

impl Program {
    /// One run [ns]. None if it failed, which it says itself.
    pub fn event_ns(&self, size: Size) -> Option<f64> {
        let mut command = Command::new(&self.command);
        command.args(&self.first);
        command.args(
            [
                u64::from(size.actors),
                u64::from(size.population),
                size.events,
            ]
            .map(|n| n.to_string()),
        );
        let output = command.output().ok()?;
        let said = String::from_utf8_lossy(&output.stdout).trim().parse().ok();
        if said.is_none() {
            eprintln!(
                "{}: {}",
                self.command.display(),
                String::from_utf8_lossy(&output.stderr)
            );
        }
        said
    }
}

/// Where this crate's compiled files are: beside the program that runs.
fn folder() -> Result<PathBuf, String> {
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    Ok(program.parent().unwrap_or(Path::new(".")).to_owned())
}

fn source(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src").join(name)
}

/// What a command says on stdout; or why there is nothing.
fn said(command: &mut Command) -> Result<String, String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command
        .output()
        .map_err(|error| format!("{name}: {error}"))?;
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    } else {
        let error = String::from_utf8_lossy(&output.stderr);
        Err(format!(
            "{name}: {}",
            error.lines().last().unwrap_or("failed")
        ))
    }
}

/// Compiles the hold model of ns-3 with this machine's compiler, optimised.
pub fn ns_3() -> Result<Program, String> {
    // Its flags name libraries that Debian's package neither needs nor brings.
    let ask = |what: &str| said(Command::new("pkg-config").args([what, "ns3-core"]));
    let include = ask("--variable=includedir")?;
    let library = ask("--variable=libdir")?;
    let command = folder()?.join("ns3_hold");
    let compiler = std::env::var("CXX").unwrap_or_else(|_| "c++".to_owned());
    let mut compile = Command::new(compiler);
    compile.args([
        "-O3",
        "-DNDEBUG",
        "-std=c++17",
        "-I",
        &include,
        "-L",
        &library,
    ]);
    compile
        .arg(source("ns3_hold.cc"))
        .arg("-o")
        .arg(&command)
        .arg("-lns3-core");
    said(&mut compile)?;
    Ok(Program {
        command,
        first: None,
    })
}

/// Takes SimPy as this machine's Python has it, or installs it beside this program.
pub fn simpy() -> Result<Program, String> {
    let has_it = |python: &Path| said(Command::new(python).args(["-c", "import simpy"]));
    let environment = folder()?.join("simpy");
    let own = environment.join("bin").join("python");
    let python = ["python3".into(), own.clone()]
        .into_iter()
        .find(|python: &PathBuf| has_it(python).is_ok());
    let command = match python {
        Some(python) => python,
        None => {
            said(
                Command::new("python3")
                    .args(["-m", "venv"])
                    .arg(&environment),
            )?;
            let install = [
                "-m",
                "pip",
                "install",
                "--quiet",
                "--disable-pip-version-check",
                "simpy",
            ];
            said(Command::new(&own).args(install))?;
            own
        }
    };
    Ok(Program {
        command,
        first: Some(source("simpy_hold.py")),
    })
}
