//! Mathematical morphology on binary, height and label images.
//!
//! Images are `Array2`s, index `[row, column]`, in any memory order; results are in standard
//! layout. What lies outside the image does not exist: windows are clipped to it. Labels count up from 1 in raster order
//! of each component's first pixel, 0 is no component, so the same image always gets the same labels.
//!
//! | file | operator | cost per pixel |
//! |---|---|---|
//! | `square` | dilation, erosion, opening, closing by a flat square (van Herk 1992, Gil and Werman 1993) | constant in the side |
//! | `area` | opening and closing by area (Vincent 1992, union-find of Meijster and Wilkinson 2002) | a sort |
//! | `components` | connected components | near constant |
//! | `flat_zones` | lambda-quasi-flat zones (Meyer 1998), also over gaps | near constant |
//! | `reconstruction` | geodesic reconstruction, filling of basins (Vincent 1993) | near constant |
//! | `gaps` | interpolation of missing heights | constant |

mod area;
mod components;
mod flat_zones;
mod gaps;
mod level;
mod neighbors;
mod reconstruction;
mod square;
mod union_find;

pub use area::{area_closing, area_opening};
pub use components::{Labels, connected_components};
pub use flat_zones::{quasi_flat_zones, quasi_flat_zones_over_gaps};
pub use gaps::fill_gaps;
pub use level::Level;
pub use neighbors::Connectivity;
pub use reconstruction::{fill_basins, reconstruct_by_dilation, reconstruct_by_erosion};
pub use square::{closing, dilate, erode, opening};
