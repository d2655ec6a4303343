//! Figures as PNG: an SVG document drawn with the fonts of the machine.

use png::{BitDepth, ColorType, Compression, Encoder, EncodingError, FilterType};
use resvg::tiny_skia::{Color, Pixmap, Transform};
use resvg::usvg::fontdb::Database;
use resvg::usvg::{Options, Tree};

/// Pixels of the image for each of the figure: sharp on paper at 15 cm.
const SCALE: f32 = 2.0;
/// Families that a figure is drawn with, the first that the machine has; else any.
const FAMILIES: [&str; 4] = ["DejaVu Sans", "Liberation Sans", "Noto Sans", "Arial"];

/// A figure could not be drawn as PNG.
#[derive(Debug, thiserror::Error)]
pub enum RasterError {
    /// No font is installed: the labels would be missing.
    #[error("no font is installed on this machine: a PNG would have no labels (apt-get install fonts-dejavu-core)")]
    NoFont,
    /// The figure could not be drawn.
    #[error("cannot draw the figure as PNG: {0}")]
    Draw(String),
}

/// Draws SVG documents.
pub struct Rasterizer<'a> {
    options: Options<'a>,
}

impl Rasterizer<'_> {
    /// Looks for a font.
    ///
    /// # Errors
    /// The machine has none.
    pub fn new() -> Result<Self, RasterError> {
        let mut options = Options::default();
        let fonts = options.fontdb_mut();
        fonts.load_system_fonts();
        let has = |fonts: &Database, name: &str| {
            fonts.faces().any(|face| face.families.iter().any(|(family, _)| family == name))
        };
        let known = FAMILIES.into_iter().find(|name| has(fonts, name)).map(str::to_owned);
        let any = || fonts.faces().find_map(|face| face.families.first().map(|(family, _)| family.clone()));
        let family = known.or_else(any).ok_or(RasterError::NoFont)?;
        fonts.set_sans_serif_family(family.clone());
        options.font_family = family;
        Ok(Self { options })
    }

    /// The PNG of an SVG document.
    ///
    /// # Errors
    /// The document cannot be drawn.
    pub fn png(&self, svg: &str) -> Result<Vec<u8>, RasterError> {
        let failed = |reason: String| RasterError::Draw(reason);
        let tree = Tree::from_str(svg, &self.options).map_err(|error| failed(error.to_string()))?;
        let size = tree.size();
        let pixels = |length: f32| (length * SCALE).ceil() as u32;
        let mut image = Pixmap::new(pixels(size.width()), pixels(size.height()))
            .ok_or_else(|| failed("it has no size".to_owned()))?;
        image.fill(Color::WHITE);
        resvg::render(&tree, Transform::from_scale(SCALE, SCALE), &mut image.as_mut());
        encoded(&image).map_err(|error| failed(error.to_string()))
    }
}

/// The PNG of an image without transparent pixels. Flat areas and lines are smaller without the filters that PNG has for
/// photographs: a sixth of what [`Pixmap::encode_png`] writes.
fn encoded(image: &Pixmap) -> Result<Vec<u8>, EncodingError> {
    let opaque: Vec<u8> = image.pixels().iter().flat_map(|pixel| [pixel.red(), pixel.green(), pixel.blue()]).collect();
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, image.width(), image.height());
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Default);
    encoder.set_filter(FilterType::NoFilter);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&opaque)?;
    writer.finish()?;
    Ok(bytes)
}
