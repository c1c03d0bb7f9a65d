"""Where five accelerometers and four shakers should go to recover the matrices of a truss."""

import lab

rig = lab.load_model("truss")
best = lab.place(rig, 5, n_actuators=4, target="matrices", quantity="acceleration")

print("sensors:  ", *best.sensors)
print("actuators:", *best.actuators)
print(f"{best.measure}: {best.figure:.3g}; proven best: {best.proven}")
