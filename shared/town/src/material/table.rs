//! The list of materials. A new material needs one line.
//!
//! Curves are percent at the anchors of `Spectrum::from_anchors`. Some are measured: means over the samples of a kind in
//! the Berlin Urban Gradient library (Okujeni et al., 2016, doi:10.5880/enmap.2016.008); `tests/suite/materials.rs` lists
//! them. Values below 460 nm, where the library starts, are extended by hand. The others are drawn by hand after the
//! families of the USGS and ECOSTRESS libraries and a color chart: brick steps at 550 nm, leaves have the red edge at 700
//! nm, dyes that are dark to the eye are bright in the infrared. Leaves are brighter than the measured crowns, which
//! include their own shadows.

use crate::material::properties::{Properties as P, curve, paint, plant};
use crate::material::texture::Pattern::{Blocks, Grain, Leafy, Plain, Rubble, Stains};
use crate::spectrum::Spectrum;

macro_rules! materials {
    ($($name:ident = $properties:expr;)*) => {
        /// A material by name.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        #[repr(u8)]
        #[allow(missing_docs, reason = "the names are self-explanatory")]
        pub enum Material { $($name),* }

        impl Material {
            /// All materials, in the order of their numbers.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// Optical properties.
            pub fn properties(self) -> P {
                match self { $(Self::$name => $properties),* }
            }

            /// Diffuse reflectance, 0 to 1.
            pub fn spectrum(self) -> Spectrum {
                self.properties().spectrum
            }
        }
    };
}

materials! {
    // Ground
    Asphalt = P::new(curve([7., 8., 9., 10., 11., 12., 12., 13., 14., 15., 16.]), Grain);
    AsphaltNew = P::new(curve([4.7, 5.3, 6.0, 6.4, 6.7, 6.9, 7.0, 7.3, 7.4, 7.7, 7.9]), Grain);
    RoadPaint = P::new(curve([45., 58., 64., 66., 67., 67., 67., 66., 65., 62., 60.]), Grain).foil(0.25);
    Slab = P::new(curve([19., 23., 26., 29., 31., 32., 33., 34., 34., 35., 36.]), blocks(0.6, 0.6, -0.35));
    Cobble = P::new(curve([15., 17., 19., 20., 21., 22., 22., 23., 23., 23., 22.]), blocks(0.14, 0.12, -0.45));
    Granite = P::new(curve([26., 29., 31., 33., 34., 35., 36., 36., 36., 35., 34.]), Grain);
    Gravel = P::new(curve([10., 12.1, 14.9, 17.0, 18.9, 19.9, 20.5, 20.9, 21.6, 22.5, 23.3]), Rubble { size: 0.04 });
    Ballast = P::new(curve([4.5, 5.1, 6.1, 7.1, 8.2, 8.5, 8.8, 9.2, 9.2, 9.1, 9.3]), Rubble { size: 0.07 });
    Soil = P::new(curve([6.0, 8.0, 10.5, 12.6, 14.8, 16.5, 18.0, 19.2, 20.4, 22.5, 24.4]), Grain);
    Sand = P::new(curve([6.5, 8.9, 11.9, 15.3, 18.4, 20.1, 21.8, 23.7, 25.2, 27.3, 29.4]), Grain);
    Grass = P::new(plant([2.0, 2.7, 3.4, 6.8, 5.5, 4.4, 13.7, 32.8, 37.8, 42.3, 43.6]), Leafy);
    DryGrass = P::new(plant([3.8, 5.0, 6.5, 8.6, 9.8, 10.7, 14.5, 21.4, 24.0, 27.8, 30.8]), Leafy);
    Water = P::new(curve([4., 4., 4., 4., 3., 2., 1.5, 1., 1., 0.5, 0.5]), Plain).loses(0.96).gloss(0.02);

    // Walls
    PlasterCream = P::new(curve([32., 42., 50., 57., 61., 63., 65., 66., 67., 68., 68.]), Stains);
    PlasterGray = P::new(curve([36., 41., 44., 46., 47., 48., 48., 49., 50., 51., 52.]), Stains);
    PlasterRose = P::new(curve([25., 30., 34., 38., 48., 53., 55., 57., 58., 60., 60.]), Stains);
    PlasterOchre = P::new(curve([14., 18., 26., 40., 48., 50., 52., 54., 55., 50., 54.]), Stains);
    PlasterWhite = P::new(curve([58., 70., 75., 77., 78., 79., 79., 80., 80., 80., 79.]), Stains);
    PlasterBlue = P::new(curve([36., 45., 47., 46., 43., 40., 40., 43., 47., 50., 52.]), Stains);
    Limestone = P::new(curve([34., 42., 48., 53., 57., 59., 61., 62., 63., 64., 65.]), blocks(0.9, 0.4, -0.25));
    LimestoneDressed = P::new(curve([33., 41., 47., 52., 55., 57., 59., 60., 61., 62., 63.]), Stains);
    Brick = P::new(curve([6., 7., 8., 12., 24., 29., 31., 33., 33., 34., 38.]), blocks(0.23, 0.078, 0.5));
    BrickYellow = P::new(curve([12., 16., 22., 31., 39., 43., 45., 47., 48., 48., 52.]), blocks(0.23, 0.078, -0.3));
    Fieldstone = P::new(curve([17., 21., 25., 29., 33., 35., 36., 37., 38., 38., 39.]), Rubble { size: 0.28 });
    Concrete = P::new(curve([10., 12.1, 14.9, 17.0, 18.9, 19.9, 20.5, 20.9, 21.6, 22.5, 23.3]), Stains);
    ConcreteNew = P::new(curve([20., 24., 27., 29., 31., 32., 33., 34., 34., 35., 35.]), Stains);
    Cladding = P::new(paint([42., 44., 46.], 48.), blocks(1.2, 0.6, -0.3));

    // Roofs
    Zinc = P::new(curve([24., 26., 27., 27., 27., 27., 27., 27., 28., 30., 36.]), blocks(0.5, 2.0, -0.15));
    ClayTile = P::new(curve([4.2, 5.0, 6.4, 8.3, 14.3, 16.9, 18.8, 20.8, 21.1, 21.5, 24.7]), blocks(0.25, 0.16, -0.35));
    Slate = P::new(curve([4.0, 4.7, 5.4, 5.6, 5.9, 6.0, 6.2, 6.6, 6.5, 5.9, 5.9]), blocks(0.22, 0.16, -0.25));
    Bitumen = P::new(curve([5.2, 6.1, 7.2, 7.5, 7.6, 7.5, 7.7, 8.2, 8.4, 8.9, 9.4]), Grain);

    // Wood, metal, glass, plastic
    Wood = P::new(curve([5., 6., 8., 11., 16., 20., 25., 33., 40., 48., 50.]), Grain);
    WoodGray = P::new(curve([12., 14., 16., 18., 20., 22., 24., 28., 32., 38., 41.]), Grain);
    WoodGreen = P::new(paint([4., 15., 9.], 38.), Plain);
    WoodBlue = P::new(paint([12., 20., 32.], 36.), Plain);
    WoodRed = P::new(paint([32., 5., 5.], 48.), Plain);
    WoodWhite = P::new(paint([66., 68., 66.], 66.), Plain);
    DarkMetal = P::new(paint([7., 8., 8.], 12.), Plain);
    GreenMetal = P::new(paint([3., 9., 6.], 16.), Plain);
    Steel = P::new(curve([34., 37., 39., 40., 41., 41., 42., 42., 42., 43., 45.]), Stains).loses(0.05).gloss(0.12);
    Rust = P::new(curve([4., 4., 5., 6., 11., 15., 18., 20., 19., 17., 21.]), Grain);
    RailHead = P::new(curve([38., 41., 43., 44., 45., 46., 47., 47., 48., 50., 54.]), Plain).loses(0.3).gloss(0.3);
    Glass = P::new(curve([3.; 11]), Plain).loses(0.88).gloss(0.25);
    CarGlass = P::new(curve([2.; 11]), Plain).loses(0.80).gloss(0.30);
    Rubber = P::new(curve([3., 3., 3., 3., 3., 3., 3., 4., 4., 4., 5.]), Plain);
    BlackPlastic = P::new(paint([4., 4., 4.], 6.), Plain);
    GreenPlastic = P::new(paint([5., 26., 9.], 42.), Plain);
    YellowPlastic = P::new(paint([70., 50., 5.], 76.), Plain);
    BluePlastic = P::new(paint([4., 14., 45.], 48.), Plain);
    OrangePlastic = P::new(paint([72., 16., 4.], 78.), Plain);
    WhitePlastic = P::new(paint([76., 77., 75.], 76.), Plain);

    // Car paints
    PaintWhite = P::new(paint([78., 80., 78.], 74.), Plain).loses(0.04).gloss(0.10);
    PaintBlack = P::new(paint([3., 3., 3.], 5.), Plain).loses(0.25).gloss(0.12);
    PaintSilver = P::new(paint([40., 41., 42.], 43.), Plain).loses(0.04).gloss(0.10);
    PaintGray = P::new(paint([15., 15., 16.], 19.), Plain).loses(0.10).gloss(0.10);
    PaintRed = P::new(paint([50., 4., 4.], 62.), Plain).loses(0.04).gloss(0.10);
    PaintBlue = P::new(paint([4., 9., 34.], 30.), Plain).loses(0.04).gloss(0.10);
    PaintGreen = P::new(paint([3., 16., 8.], 34.), Plain).loses(0.06).gloss(0.10);
    PaintBeige = P::new(paint([52., 46., 36.], 58.), Plain).loses(0.04).gloss(0.10);
    PaintYellow = P::new(paint([74., 55., 4.], 78.), Plain).loses(0.04).gloss(0.10);

    // Foils and lights
    SignRed = P::new(paint([50., 3., 4.], 55.), Plain).foil(1.0).gloss(0.02);
    SignBlue = P::new(paint([3., 12., 50.], 40.), Plain).foil(1.0).gloss(0.02);
    SignWhite = P::new(paint([72., 73., 71.], 72.), Plain).foil(1.0).gloss(0.02);
    SignYellow = P::new(paint([70., 48., 3.], 74.), Plain).foil(1.0).gloss(0.02);
    SignGreen = P::new(paint([3., 28., 12.], 38.), Plain).foil(1.0).gloss(0.02);
    Licence = P::new(paint([66., 66., 64.], 66.), Plain).foil(0.8);
    TailLamp = P::new(paint([42., 2., 3.], 50.), Plain).foil(0.35).gloss(0.06);
    Lamp = P::new(curve([60., 66., 70., 72., 72., 72., 72., 72., 72., 70., 70.]), Plain);
    LightRed = P::new(paint([92., 6., 4.], 60.), Plain);
    LightAmber = P::new(paint([38., 22., 2.], 40.), Plain);
    LightGreen = P::new(paint([4., 40., 24.], 30.), Plain);
    HighVisibility = P::new(paint([62., 78., 6.], 80.), Plain).foil(0.3);

    // Plants
    Bark = P::new(curve([6., 7., 9., 12., 15., 18., 22., 28., 33., 40., 44.]), Grain);
    BarkPlane = P::new(curve([16., 20., 25., 30., 33., 34., 36., 41., 44., 47., 49.]), Rubble { size: 0.35 });
    Leaves = P::new(plant([3., 4., 5., 13., 8., 5., 14., 44., 50., 52., 51.]), Leafy);
    LeavesDark = P::new(plant([2., 3., 3., 7., 5., 3., 9., 34., 40., 43., 43.]), Leafy);
    LeavesYoung = P::new(plant([4., 5., 8., 20., 15., 9., 22., 50., 55., 57., 55.]), Leafy);
    Needles = P::new(plant([2.5, 3.0, 3.6, 5.8, 4.7, 3.8, 11., 28., 32., 34., 34.]), Leafy);
    Blossom = P::new(curve([12., 10., 6., 5., 30., 55., 60., 62., 63., 63., 62.]), Leafy);

    // People
    SkinLight = P::new(curve([15., 20., 26., 29., 43., 52., 56., 60., 61., 58., 45.]), Plain);
    SkinBrown = P::new(curve([8., 10., 13., 16., 25., 33., 38., 45., 50., 53., 43.]), Plain);
    SkinDark = P::new(curve([4., 5., 6., 7., 10., 14., 18., 26., 34., 46., 40.]), Plain);
    HairBlack = P::new(curve([2., 2., 2., 2., 2., 3., 3., 5., 8., 16., 22.]), Plain);
    HairBrown = P::new(curve([3., 4., 5., 6., 8., 11., 14., 19., 25., 35., 40.]), Plain);
    HairBlond = P::new(curve([11., 15., 20., 26., 33., 39., 44., 49., 53., 58., 59.]), Plain);
    HairGray = P::new(paint([32., 32., 31.], 48.), Plain);
    Denim = P::new(paint([7., 10., 21.], 50.), Plain);
    BlackCloth = P::new(paint([3., 3., 3.], 30.), Plain);
    GrayCloth = P::new(paint([16., 16., 17.], 45.), Plain);
    WhiteCloth = P::new(paint([72., 73., 74.], 70.), Plain);
    BeigeCloth = P::new(paint([46., 37., 26.], 58.), Plain);
    RedCloth = P::new(paint([46., 7., 8.], 60.), Plain);
    GreenCloth = P::new(paint([9., 22., 12.], 52.), Plain);
    BlueCloth = P::new(paint([8., 18., 44.], 55.), Plain);
    YellowCloth = P::new(paint([68., 52., 8.], 70.), Plain);
    Leather = P::new(paint([14., 8., 5.], 40.), Plain);
}

const fn blocks(width: f32, height: f32, joint: f32) -> crate::material::texture::Pattern {
    Blocks { width, height, joint }
}
