//! The native part of the Python package `replica`. `replica/` has the public part.
//!
//! A stage in Python runs in the runner of the crate `stage`: the same command line, barriers, credits and exit codes as in Rust. Messages
//! are numpy arrays over shared memory, without a copy; arrays of a message that was given back are refused.
//!
//! The package also reads recordings and observes running pipelines, and makes the range images that networks in Python need.
//!
//! It must never keep shared memory of a message that its owner has given back, and never decide something that the crate `stage`
//! decides: settings, ports and states are only passed on.
//!
//! Start reading at `program` (a Python class as a stage), then `session` (calls of a step) and `memory` (arrays over shared
//! memory).

mod memory;
mod observation;
mod program;
mod recording;
mod session;
mod spec;
mod sweep_images;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use stage::Port;
use stage::messages::columns::COLUMNS;
use stage::messages::{CLASS_TABLE_VERSION, ClassId, pod};
use std::ffi::OsString;
use std::path::PathBuf;

/// The native part of `replica`.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::memory::Memory;
    #[pymodule_export]
    use super::observation::Observation;
    #[pymodule_export]
    use super::recording::RecordingFile;
    #[pymodule_export]
    use super::session::{count, doubt, loan, mark_progress, note, publish, set_drive_time};
    #[pymodule_export]
    use super::sweep_images::{SubmapImages, SweepImages};
    #[pymodule_export]
    use super::{classes, columns, find_file, fingerprint, run, topics};
}

/// The `main` of a stage's program; the exit code. `spec` is JSON, `host` as in `_host.py`.
#[pyfunction]
fn run(py: Python<'_>, host: Py<PyAny>, spec: &str, arguments: Vec<OsString>) -> PyResult<u8> {
    let spec = serde_json::from_str(spec).map_err(|error| PyValueError::new_err(error.to_string()))?;
    let program = program::PythonProgram::new(host, spec).map_err(PyValueError::new_err)?;
    // Other threads of Python run while the stage waits: each call of the host takes the lock.
    Ok(py.detach(|| stage::run_program(&program, arguments)))
}

/// The layouts of all topics, as JSON.
#[pyfunction]
fn topics() -> PyResult<String> {
    let tables: Vec<_> = Port::all().iter().map(Port::byte_table).collect();
    serde_json::to_string(&tables).map_err(|error| PyValueError::new_err(error.to_string()))
}

/// The table of columns, as JSON.
#[pyfunction]
fn columns() -> PyResult<String> {
    serde_json::to_string(COLUMNS).map_err(|error| PyValueError::new_err(error.to_string()))
}

/// Version of the class table, and its names by id.
#[pyfunction]
fn classes() -> (u64, Vec<&'static str>) {
    (CLASS_TABLE_VERSION, ClassId::ALL.iter().map(|class| class.name()).collect())
}

/// The fingerprint of bytes that identifies a model.
#[pyfunction]
fn fingerprint(bytes: &[u8]) -> u64 {
    pod::fingerprint(pod::FINGERPRINT_START, bytes)
}

/// The file that a setting names.
#[pyfunction]
#[allow(clippy::needless_pass_by_value, reason = "Python has no paths to borrow")]
fn find_file(launch_folder: PathBuf, named: PathBuf) -> PathBuf {
    stage::find_file(&launch_folder, &named)
}
