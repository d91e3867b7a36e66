//! Statistics, diagnosis and charts of reflectances by band (thesis section 4.3.1).

pub mod channel;
pub mod charts;
pub mod diagnosis;
pub mod moments;
pub mod source;
