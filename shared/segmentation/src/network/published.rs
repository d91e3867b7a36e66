//! Networks on images as they were published, to compare with: the Spherical `DZNet` of the thesis. No shipped model uses it.

pub(super) mod spherical_dz;
