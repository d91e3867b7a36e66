//! Images of sweeps for a network in Python, and classes from its scores.

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes};
use segmentation::intensity::IntensityUse;
use segmentation::spherical::{LoadedImages, OwnedSpectra, OwnedSubmap, SubmapSweeps};
use segmentation::{Options, Refinement, SegmentationError};
use stage::messages::pod::{Pod, bytes_from_rows, bytes_from_rows_mut, zeroed_rows};
use std::path::PathBuf;
use std::sync::Arc;

/// The settings of a model file, without its network.
#[pyclass(frozen)]
pub struct SweepImages {
    images: Arc<segmentation::spherical::SweepImages>,
    digest: u64,
}

/// Header and rows of a message.
type MessageBytes = (PyBuffer<u8>, PyBuffer<u8>);

#[pymethods]
impl SweepImages {
    #[new]
    #[allow(clippy::needless_pass_by_value, reason = "Python has no paths to borrow")]
    fn load(
        model: PathBuf,
        every: usize,
        intensity: &str,
        rough_ground: bool,
        vehicle_shape: bool,
        driven_is_road: bool,
    ) -> PyResult<Self> {
        let intensity = intensity.parse::<IntensityUse>();
        let intensity = intensity.map_err(|error| PyValueError::new_err(format!("intensity: {error}")))?;
        let refinement = Refinement { rough_ground, vehicle_shape, driven_is_road, ..Refinement::NONE };
        let loaded = segmentation::spherical::SweepImages::load(&model).map_err(|error| exception(&error))?;
        let LoadedImages { images, card } = loaded;
        let images = images.with_options(Options { every, intensity, refinement, ..Options::default() });
        Ok(Self { images: Arc::new(images), digest: card.digest })
    }

    /// Identifies the model file.
    #[getter]
    fn digest(&self) -> u64 {
        self.digest
    }

    /// The settings of the model file as JSON.
    fn settings(&self) -> PyResult<String> {
        serde_json::to_string(self.images.settings()).map_err(|error| PyValueError::new_err(error.to_string()))
    }

    /// A submap, and the columns that the model reads, copied.
    #[allow(clippy::needless_pass_by_value, reason = "Python has no buffers to borrow")]
    fn project(
        &self,
        py: Python<'_>,
        submap: MessageBytes,
        color: Option<MessageBytes>,
        spectra: Option<MessageBytes>,
    ) -> PyResult<SubmapImages> {
        let asked = self.images.settings().features.columns();
        let given =
            [("color", asked.color, color.is_some()), ("spectra", !asked.wavelengths_nm.is_empty(), spectra.is_some())];
        if let Some((topic, ..)) = given.iter().find(|(_, is_asked, is_given)| *is_asked && !is_given) {
            return Err(PyValueError::new_err(format!("the model reads {topic}; pass {topic}=MESSAGE")));
        }
        let submap = OwnedSubmap {
            header: header(py, &submap.0)?,
            points: rows(py, &submap.1)?,
            colors: color.map(|color| rows(py, &color.1)).transpose()?,
            spectra: spectra
                .map(|spectra| {
                    Ok::<_, PyErr>(OwnedSpectra { header: header(py, &spectra.0)?, rows: rows(py, &spectra.1)? })
                })
                .transpose()?,
        };
        let sweeps = py.detach(|| SubmapSweeps::new(Arc::clone(&self.images), submap));
        sweeps.map(SubmapImages).map_err(|error| exception(&error))
    }
}

/// The sweeps of a submap.
#[pyclass]
pub struct SubmapImages(SubmapSweeps);

#[pymethods]
impl SubmapImages {
    /// Channels, rows and columns of the image of each sweep.
    fn sizes(&self) -> Vec<[usize; 3]> {
        self.0.sizes()
    }

    /// The images of `n` sweeps from `first` on, f32.
    fn images<'py>(&mut self, py: Python<'py>, first: usize, n: usize) -> Bound<'py, PyByteArray> {
        let images = py.detach(|| self.0.images(first..first + n));
        PyByteArray::new(py, bytes_from_rows(&images))
    }

    /// Takes the scores of a sweep.
    #[allow(clippy::needless_pass_by_value, reason = "Python has no buffers to borrow")]
    fn vote(&mut self, py: Python<'_>, sweep: usize, scores: PyBuffer<f32>) -> PyResult<()> {
        let scores = scores.to_vec(py)?;
        py.detach(|| self.0.vote(sweep, &scores)).map_err(|error| exception(&error))
    }

    /// The rows of the topic `class`.
    fn classes<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let classes = py.detach(|| self.0.classes().classes);
        PyBytes::new(py, bytes_from_rows(&classes))
    }
}

/// The header of a message in a buffer.
fn header<T: Pod>(py: Python<'_>, bytes: &PyBuffer<u8>) -> PyResult<Box<T>> {
    let mut headers: Vec<T> = rows(py, bytes)?;
    headers.pop().map(Box::new).ok_or_else(|| PyValueError::new_err("a message without a header"))
}

/// The rows of a message in a buffer.
fn rows<T: Pod>(py: Python<'_>, bytes: &PyBuffer<u8>) -> PyResult<Vec<T>> {
    let mut rows = zeroed_rows(bytes.len_bytes() / size_of::<T>());
    // Fails if the sizes differ.
    bytes.copy_to_slice(py, bytes_from_rows_mut(&mut rows))?;
    Ok(rows)
}

fn exception(error: &SegmentationError) -> PyErr {
    PyValueError::new_err(error.to_string())
}
