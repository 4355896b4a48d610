//! Draws every kind of picture from invented data, as SVG and PNG, and writes a
//! path file and a log, into the folder that is given or into `out/gallery`.

mod data;
mod pictures;

use std::path::PathBuf;

use tensegra_io::{LogOptions, PathFile, write_log, write_path_file};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).unwrap_or("out/gallery".to_owned());
    let folder = PathBuf::from(folder);
    for (name, picture) in pictures::pictures()? {
        picture.write_svg(&folder.join(format!("{name}.svg")))?;
        picture.write_png(&folder.join(format!("{name}.png")), 2.0)?;
    }
    for (problem, path) in [data::kite(), data::prism()] {
        let file = folder.join(format!("{}.mcap", problem.name));
        write_log(&file, &problem, &path, &LogOptions::default())?;
        let file = folder.join(format!("{}.json", problem.name));
        write_path_file(&file, &PathFile::new(&problem, path))?;
    }
    Ok(())
}
