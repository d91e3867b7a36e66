//! Published networks on images, for comparison: the Spherical `DZNet` of the thesis. No shipped model uses it.

pub(super) mod spherical_dz;
