//! Memory of a message, for Python.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// Bytes of a message, for `numpy.asarray`: the array keeps this object, and this object keeps the message from being
/// dropped ([`Lease`]). An address, not a reference: the message belongs to the thread of the stage, arrays may go to any thread.
#[pyclass(frozen)]
pub struct Memory {
    address: usize,
    n_bytes: usize,
    is_writable: bool,
    _user: Arc<()>,
}

#[pymethods]
impl Memory {
    /// The array interface of numpy, version 3.
    #[getter]
    fn __array_interface__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let interface = PyDict::new(py);
        interface.set_item("version", 3)?;
        interface.set_item("typestr", "|u1")?;
        interface.set_item("shape", (self.n_bytes,))?;
        interface.set_item("data", (self.address, !self.is_writable))?;
        Ok(interface)
    }
}

/// The owner of the bytes of [`Memory`] uses this to check whether they are still in use.
#[derive(Default)]
pub struct Lease(Arc<()>);

impl Lease {
    /// Memory that is only read.
    pub fn read(&self, bytes: &[u8]) -> Memory {
        self.memory(bytes.as_ptr() as usize, bytes.len(), false)
    }
    /// Memory that is written only through the array, as long as it is in use.
    pub fn write(&self, bytes: &mut [u8]) -> Memory {
        self.memory(bytes.as_mut_ptr() as usize, bytes.len(), true)
    }
    fn memory(&self, address: usize, n_bytes: usize, is_writable: bool) -> Memory {
        Memory { address, n_bytes, is_writable, _user: Arc::clone(&self.0) }
    }
    /// Whether an object of Python refers to the bytes.
    pub fn is_used(&self) -> bool {
        Arc::strong_count(&self.0) > 1
    }
}
