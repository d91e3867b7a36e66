//! Statistics, diagnosis and charts of reflectances by band (thesis section 4.3.1).
//!
//! A [`source::Source`] is an input (images of one camera, or the spectra of the points of a run) with a [`channel::Channel`] for each
//! band. [`diagnosis`] finds its problems, [`charts`] draw it.

pub mod channel;
pub mod charts;
pub mod diagnosis;
pub mod moments;
pub mod source;
