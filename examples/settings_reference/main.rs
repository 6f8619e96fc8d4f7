//! Writes docs/settings.md from the settings themselves: `cargo run --example settings_reference`.

mod reference;

fn main() -> std::io::Result<()> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/settings.md");
    std::fs::write(path, reference::page())?;
    println!("wrote {path}");
    Ok(())
}
