//! A recording, message by message.

use messages::pod::bytes_from_rows;
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use recording::{RecordingError, RecordingReader};
use stage::messages;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// Reads a recording from start to end.
#[pyclass(frozen)]
pub struct RecordingFile(Mutex<RecordingReader>);

/// Topic, envelope, header, rows.
type RecordedBytes<'py> = (String, Bound<'py, PyBytes>, Bound<'py, PyBytes>, Bound<'py, PyBytes>);

#[pymethods]
impl RecordingFile {
    /// Opens a file.
    #[new]
    #[allow(clippy::needless_pass_by_value, reason = "Python has no paths to borrow")]
    fn open(path: PathBuf) -> PyResult<Self> {
        RecordingReader::open(&path).map(|reader| Self(Mutex::new(reader))).map_err(|error| exception(&error))
    }

    /// The layouts of its topics as JSON, by name; `topic.tick` are the ticks of `topic`.
    fn tables(&self) -> PyResult<String> {
        let reader = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let tables: BTreeMap<_, _> = reader.topics().iter().map(|topic| (&topic.name, &topic.table)).collect();
        serde_json::to_string(&tables).map_err(|error| PyValueError::new_err(error.to_string()))
    }

    /// Metadata of the run, from the recording.
    fn about(&self) -> BTreeMap<String, String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).about().clone()
    }

    /// The next message of these topics; `None` at the end.
    #[allow(clippy::needless_pass_by_value, reason = "Python has no strings to borrow")]
    fn next<'py>(&self, py: Python<'py>, topics: Vec<String>) -> PyResult<Option<RecordedBytes<'py>>> {
        let mut reader = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        while let Some(message) = reader.next().map_err(|error| exception(&error))? {
            if topics.contains(&message.topic.name) {
                let envelope = PyBytes::new(py, bytes_from_rows(std::slice::from_ref(&message.envelope)));
                let header = PyBytes::new(py, message.header());
                let rows = PyBytes::new(py, message.rows());
                return Ok(Some((message.topic.name.clone(), envelope, header, rows)));
            }
        }
        Ok(None)
    }
}

fn exception(error: &RecordingError) -> PyErr {
    PyOSError::new_err(error.to_string())
}
