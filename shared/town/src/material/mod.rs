//! Materials: reflectance spectrum, texture, gloss and retroreflection of surfaces.
//!
//! Color and near-infrared reflectance follow from one spectrum, so that all wavelengths agree.

mod kind;
mod properties;
mod table;
mod texture;

pub use properties::Properties;
pub use table::Material;
