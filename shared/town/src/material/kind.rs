//! Materials of the town as a spectral camera can distinguish them.

use super::Material;
use messages::MaterialId;

impl Material {
    /// Optical material of the surface: painted wood or metal is paint. `None` for lights, skin and hair, which have no
    /// [`MaterialId`].
    pub const fn id(self) -> Option<MaterialId> {
        use Material::{
            Asphalt, AsphaltNew, Ballast, Bark, BarkPlane, BeigeCloth, Bitumen, BlackCloth, BlackPlastic, Blossom,
            BlueCloth, BluePlastic, Brick, BrickYellow, CarGlass, Cladding, ClayTile, Cobble, Concrete, ConcreteNew,
            DarkMetal, Denim, DryGrass, Fieldstone, Glass, Granite, Grass, Gravel, GrayCloth, GreenCloth, GreenMetal,
            GreenPlastic, HairBlack, HairBlond, HairBrown, HairGray, HighVisibility, Lamp, Leather, Leaves, LeavesDark,
            LeavesYoung, Licence, LightAmber, LightGreen, LightRed, Limestone, LimestoneDressed, Needles,
            OrangePlastic, PaintBeige, PaintBlack, PaintBlue, PaintGray, PaintGreen, PaintRed, PaintSilver, PaintWhite,
            PaintYellow, PlasterBlue, PlasterCream, PlasterGray, PlasterOchre, PlasterRose, PlasterWhite, RailHead,
            RedCloth, RoadPaint, Rubber, Rust, Sand, SignBlue, SignGreen, SignRed, SignWhite, SignYellow, SkinBrown,
            SkinDark, SkinLight, Slab, Slate, Soil, Steel, TailLamp, Water, WhiteCloth, WhitePlastic, Wood, WoodBlue,
            WoodGray, WoodGreen, WoodRed, WoodWhite, YellowCloth, YellowPlastic, Zinc,
        };
        Some(match self {
            Asphalt | AsphaltNew | Bitumen => MaterialId::Asphalt,
            Concrete | ConcreteNew | Slab => MaterialId::Concrete,
            Cobble | Granite | Gravel | Ballast | Limestone | LimestoneDressed | Fieldstone | Slate => {
                MaterialId::Stone
            }
            Brick | BrickYellow | ClayTile => MaterialId::Brick,
            RoadPaint | PlasterCream | PlasterGray | PlasterRose | PlasterOchre | PlasterWhite | PlasterBlue
            | Cladding | WoodGreen | WoodBlue | WoodRed | WoodWhite | DarkMetal | GreenMetal | PaintWhite
            | PaintBlack | PaintSilver | PaintGray | PaintRed | PaintBlue | PaintGreen | PaintBeige | PaintYellow => {
                MaterialId::Paint
            }
            Zinc | Steel | Rust | RailHead => MaterialId::Metal,
            Glass | CarGlass => MaterialId::Glass,
            Wood | WoodGray | Bark | BarkPlane => MaterialId::Wood,
            Grass | Leaves | LeavesDark | LeavesYoung | Needles | Blossom => MaterialId::Vegetation,
            DryGrass => MaterialId::DryVegetation,
            Soil | Sand => MaterialId::Soil,
            Water => MaterialId::Water,
            Rubber | BlackPlastic | GreenPlastic | YellowPlastic | BluePlastic | OrangePlastic | WhitePlastic
            | SignRed | SignBlue | SignWhite | SignYellow | SignGreen | Licence | HighVisibility | Denim
            | BlackCloth | GrayCloth | WhiteCloth | BeigeCloth | RedCloth | GreenCloth | BlueCloth | YellowCloth
            | Leather => MaterialId::Fabric,
            TailLamp | Lamp | LightRed | LightAmber | LightGreen | SkinLight | SkinBrown | SkinDark | HairBlack
            | HairBrown | HairBlond | HairGray => return None,
        })
    }
}
