//! Mathematical morphology on binary, height and label images.
//!
//! Images are `Array2`s, index `[row, column]`, in any memory order; results are in standard
//! layout. What lies outside the image does not exist: windows are clipped to it. Labels count up from 1 in raster order
//! of each component's first pixel, 0 is no component, so the same image always gets the same labels.
//!
//! | file | operator | cost per pixel |
//! |---|---|---|
//! | `flat` | dilation, erosion, opening, closing by flat elements (`element`: squares, rectangles, lines, discs, any set) | constant for rectangles but for log2 of the width along the row; log2 of the length for lines; else the element's rows |
//! | `area` | opening and closing by area (Vincent 1992, union-find of Meijster and Wilkinson 2002) | a radix sort |
//! | `components` | connected components, by runs (`runs`) | near constant |
//! | `extrema` | regional maxima and minima, h-maxima | near constant |
//! | `flat_zones` | lambda-quasi-flat zones (Meyer 1998), also over gaps | near constant |
//! | `geodesic` | geodesic distances and elongation (Lantuejoul and Maisonneuve 1984) | a heap |
//! | `reconstruction` | geodesic reconstruction, filling of basins (Vincent 1993) | near constant |
//! | `watershed` | basins of markers (Meyer 1991) | constant up to 16 bits, else a radix sort |
//! | `gaps` | interpolation of missing heights | constant |
//! | `slope` | the highest image below one that rises slowly enough | constant |

mod area;
mod blocks;
mod components;
mod element;
mod extrema;
mod flat;
mod flat_zones;
mod gaps;
mod geodesic;
mod high;
mod level;
mod low;
mod neighbors;
mod order;
mod padded;
mod parts;
mod picks;
mod reconstruction;
mod rows;
mod runs;
mod sliding;
mod slope;
mod union_find;
mod watershed;

pub use area::{area_closing, area_opening};
pub use components::{Labels, connected_components};
pub use element::Element;
pub use extrema::{Height, h_maxima, regional_maxima, regional_minima};
pub use flat::{closing, dilate, erode, opening};
pub use flat_zones::{quasi_flat_zones, quasi_flat_zones_over_gaps};
pub use gaps::fill_gaps;
pub use geodesic::{geodesic_distances, geodesic_elongations};
pub use level::Level;
pub use neighbors::Connectivity;
pub use reconstruction::{fill_basins, reconstruct_by_dilation, reconstruct_by_erosion};
pub use slope::limit_rise;
pub use watershed::watershed;
