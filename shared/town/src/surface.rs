//! Surface attributes of a primitive: class, instance and material.

use crate::material::Material;
use messages::ClassId;

/// Surface attributes of a primitive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Surface {
    /// Semantic class.
    pub class: ClassId,
    /// Instance; 0 = no instance. Each vehicle and pedestrian has one.
    pub instance: u16,
    /// Optical material.
    pub material: Material,
}
