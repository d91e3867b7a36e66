//! Mathematical morphology on binary, height and label images.
//!
//! Ground detection, corrections of classes, instances and coloring use these operators on top views, range images and
//! masks. Images are `Array2`s with index `[row, column]` in any memory order. Results are in standard layout. Windows
//! are clipped to the image. Labels increase from 1 in raster order of the first pixels of the components, so equal
//! images have equal labels. Label 0 marks pixels outside all components.
//!
//! The operators are implemented here because no crate has them for `f32` heights with union-find and vectorized rows
//! (`lab/peers/morphology.py` compares times and results with scikit-image, OpenCV and others).
//!
//! | file | operator | cost per pixel |
//! |---|---|---|
//! | `flat` | dilation, erosion, opening, closing by flat elements (`element`: squares, rectangles, lines, discs, any set) | log2 of the width for rectangles, log2 of the length for lines, otherwise the rows of the element |
//! | `area` | opening and closing by area (Vincent 1992, union-find of Meijster and Wilkinson 2002) | a radix sort |
//! | `components` | connected components of runs (`runs`) | nearly constant |
//! | `extrema` | regional maxima and minima, h-maxima | nearly constant |
//! | `flat_zones` | lambda-quasi-flat zones (Meyer 1998), also over gaps | nearly constant |
//! | `geodesic` | geodesic distances and elongation (Lantuejoul and Maisonneuve 1984) | a heap |
//! | `reconstruction` | geodesic reconstruction, filling of basins (Vincent 1993) | nearly constant |
//! | `watershed` | basins of markers (Meyer 1991) | constant up to 16 bits, else a radix sort |
//! | `gaps` | interpolation of missing heights | constant |
//! | `slope` | limited slope: erosion by a cone | constant |
//!
//! An operator does not depend on streets, points or classes: the caller sets thresholds in metres. It never changes
//! its input, never depends on the memory order of the image or on the instruction set, and never gives labels in an
//! order other than raster order.
//!
//! Where to start reading: `components.rs` is the shortest complete operator; `flat.rs` shows how rows are processed in vector registers
//! (`rows.rs`, `sliding.rs`); `level.rs` is the trait of the pixel types. `tests/suite/against_definitions.rs` has each definition in a
//! few lines.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

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
mod labels;
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
mod source;
mod union_find;
mod watershed;

pub use area::{area_closing, area_opening};
pub use components::connected_components;
pub use element::Element;
pub use extrema::{Height, h_maxima, regional_maxima, regional_minima};
pub use flat::{closing, dilate, erode, opening};
pub use flat_zones::{quasi_flat_zones, quasi_flat_zones_over_gaps};
pub use gaps::fill_gaps;
pub use geodesic::{geodesic_distances, geodesic_elongations};
pub use labels::Labels;
pub use level::Level;
pub use neighbors::Connectivity;
pub use reconstruction::{fill_basins, reconstruct_by_dilation, reconstruct_by_erosion};
pub use slope::limit_rise;
pub use watershed::watershed;
