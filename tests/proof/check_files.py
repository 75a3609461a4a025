"""Has the checkers of USD and MaterialX judge an export: check_files.py EXPORT; prints one JSON object."""
import glob
import json
import os
import sys


def usd(folder):
    from pxr import Usd, UsdGeom, UsdLux, UsdShade, UsdValidation

    # What `usdchecker` runs.
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    found = {}
    for path in sorted(glob.glob(os.path.join(folder, "usd", "*.usd[az]"))):
        stage = Usd.Stage.Open(path)
        errors = [f"{error.GetType()} {error.GetName()}: {error.GetMessage()}" for error in context.Validate(stage)]
        mesh = next(UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh))
        material, _ = UsdShade.MaterialBindingAPI(mesh.GetPrim()).ComputeBoundMaterial()
        found[os.path.basename(path)] = {
            "errors": errors, "points": len(mesh.GetPointsAttr().Get()), "faces": len(mesh.GetFaceVertexCountsAttr().Get()),
            "bound": bool(material), "dome_lights": sum(prim.IsA(UsdLux.DomeLight) for prim in stage.Traverse()),
        }
    return found


def materialx(folder):
    import MaterialX as mx
    import MaterialX.PyMaterialXGenGlsl as glsl
    import MaterialX.PyMaterialXGenShader as generator

    library = mx.createDocument()
    search = mx.getDefaultDataSearchPath()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), search, library)
    document = mx.createDocument()
    path = glob.glob(os.path.join(folder, "materialx", "*.mtlx"))[0]
    mx.readFromXmlFile(document, path)
    document.setDataLibrary(library)
    valid, message = document.validate()
    material = document.getMaterialNodes()[0]
    # Kept by a name: the context does not keep it.
    shader_generator = glsl.GlslShaderGenerator.create()
    context = generator.GenContext(shader_generator)
    context.registerSourceCodeSearchPath(search)
    shader = shader_generator.generate("surface", material, context)
    return {"valid": valid, "message": message, "glsl_lines": shader.getSourceCode("pixel").count("\n")}


def main():
    kind, folder = sys.argv[1:3]
    print(json.dumps({"usd": usd, "materialx": materialx}[kind](folder)))


main()
