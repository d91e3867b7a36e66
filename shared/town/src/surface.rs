//! What a primitive is: its class, its instance and its material.

use crate::material::Material;
use messages::ClassId;

/// What a primitive belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Surface {
    /// Meaning.
    pub class: ClassId,
    /// 0 = none; vehicles and pedestrians have one each.
    pub instance: u16,
    /// Looks.
    pub material: Material,
}
