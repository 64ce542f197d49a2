"""FMUs in C with arrays, whole numbers, truths and events; see the equations in their files."""

from tests.helpers.packed_fmu import FOLDER, build_packed

DESCRIPTION_3 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Kinds" instantiationToken="{kinds}">
  <CoSimulation modelIdentifier="kinds_fmi3" canHandleVariableCommunicationStepSize="true"
    canGetAndSetFMUState="true"/>
  <UnitDefinitions><Unit name="m"><BaseUnit m="1"/></Unit></UnitDefinitions>
  <TypeDefinitions>
    <EnumerationType name="Mode"><Item name="low" value="1"/><Item name="high" value="3"/></EnumerationType>
  </TypeDefinitions>
  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.125"/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
    <UInt64 name="columns" valueReference="14" causality="structuralParameter" variability="fixed" start="3"/>
    <Float64 name="A" valueReference="1" causality="parameter" variability="tunable" start="1 2 3 4 5 6">
      <Dimension start="2"/><Dimension valueReference="14"/></Float64>
    <Float64 name="u" valueReference="2" causality="input" start="1 0 0"><Dimension start="3"/></Float64>
    <Float64 name="x" valueReference="3" causality="output" initial="exact" start="0 10 0" unit="m">
      <Dimension start="3"/></Float64>
    <Float64 name="y" valueReference="4" causality="output"><Dimension start="2"/></Float64>
    <Float64 name="end" valueReference="5" causality="parameter" variability="fixed" start="1e9"/>
    <Int8 name="n" valueReference="6" causality="input" start="3" min="-100" max="100"/>
    <Int16 name="m" valueReference="7" causality="output"/>
    <Boolean name="on" valueReference="8" causality="input" start="false"/>
    <Int32 name="count" valueReference="9" causality="output" initial="exact" start="0"/>
    <Enumeration name="mode" declaredType="Mode" valueReference="10" causality="parameter"
      variability="tunable" start="1"/>
    <Float32 name="f" valueReference="11" causality="input" start="0"/>
    <Float32 name="g" valueReference="12" causality="output"/>
    <UInt64 name="big" valueReference="13" causality="input" start="0"/>
    <String name="label" valueReference="15" causality="parameter" variability="fixed">
      <Start value="a"/></String>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="3" dependencies=""/><Output valueReference="4" dependencies=""/>
    <Output valueReference="7" dependencies="6"/><Output valueReference="9" dependencies=""/>
    <Output valueReference="12" dependencies="8 11"/>
    <InitialUnknown valueReference="4"/><InitialUnknown valueReference="7"/>
    <InitialUnknown valueReference="12"/>
  </ModelStructure>
</fmiModelDescription>
"""
DESCRIPTION_2 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Counted" guid="{counted}">
  <CoSimulation modelIdentifier="kinds_fmi2" canHandleVariableCommunicationStepSize="true"/>
  <TypeDefinitions><SimpleType name="Mode"><Enumeration>
    <Item name="one" value="1"/><Item name="two" value="2"/></Enumeration></SimpleType></TypeDefinitions>
  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.125"/>
  <ModelVariables>
    <ScalarVariable name="x" valueReference="0" causality="output" initial="exact">
      <Real start="0.5"/></ScalarVariable>
    <ScalarVariable name="end" valueReference="1" causality="parameter" variability="fixed">
      <Real start="1e9"/></ScalarVariable>
    <ScalarVariable name="n" valueReference="0" causality="input" variability="discrete">
      <Integer start="2"/></ScalarVariable>
    <ScalarVariable name="count" valueReference="1" causality="output" variability="discrete" initial="exact">
      <Integer start="0"/></ScalarVariable>
    <ScalarVariable name="mode" valueReference="2" causality="parameter" variability="tunable">
      <Enumeration declaredType="Mode" start="1"/></ScalarVariable>
    <ScalarVariable name="product" valueReference="3" causality="output" variability="discrete">
      <Integer/></ScalarVariable>
    <ScalarVariable name="on" valueReference="0" causality="input" variability="discrete">
      <Boolean start="true"/></ScalarVariable>
    <ScalarVariable name="odd" valueReference="1" causality="output" variability="discrete">
      <Boolean/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="1" dependencies=""/><Unknown index="4" dependencies=""/>
      <Unknown index="6" dependencies="3"/><Unknown index="8" dependencies="3"/></Outputs>
    <InitialUnknowns><Unknown index="6"/><Unknown index="8"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""
EVENTS = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Ball" instantiationToken="{ball}">
  <ModelExchange modelIdentifier="events_fmi3" canGetAndSetFMUState="true"/>
  <DefaultExperiment startTime="0" stopTime="3" stepSize="0.01"/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
    <Float64 name="h" valueReference="1" causality="output" initial="exact" start="1" reinit="true"/>
    <Float64 name="v" valueReference="2" causality="output" initial="exact" start="0" reinit="true"/>
    <Float64 name="h_dot" valueReference="3" causality="local" derivative="1"/>
    <Float64 name="v_dot" valueReference="4" causality="local" derivative="2"/>
    <Float64 name="g" valueReference="5" causality="parameter" variability="tunable" start="9.81"/>
    <Float64 name="e" valueReference="6" causality="parameter" variability="fixed" start="0.7"/>
    <Float64 name="floor" valueReference="7" causality="parameter" variability="fixed" start="-1e9"/>
    <Int32 name="kick" valueReference="8" causality="input" start="0"/>
    <Int32 name="bounces" valueReference="9" causality="output"/>
    <Int32 name="quarters" valueReference="10" causality="output"/>
    <Int32 name="last" valueReference="11" causality="parameter" variability="fixed" start="1000000"/>
    <Float64 name="z" valueReference="12" causality="local"/>
    <Float64 name="ticks" valueReference="13" causality="output" variability="discrete"/>
    <Float64 name="stop" valueReference="14" causality="parameter" variability="fixed" start="1e9"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="1"/><Output valueReference="2"/><Output valueReference="9"/>
    <Output valueReference="10"/><Output valueReference="13"/>
    <ContinuousStateDerivative valueReference="3"/><ContinuousStateDerivative valueReference="4"/>
    <InitialUnknown valueReference="3"/><InitialUnknown valueReference="4"/>
    <InitialUnknown valueReference="9"/><InitialUnknown valueReference="10"/>
    <InitialUnknown valueReference="13"/>
    <EventIndicator valueReference="12"/>
  </ModelStructure>
</fmiModelDescription>
"""
DESCRIPTIONS = {"kinds_fmi3": DESCRIPTION_3, "kinds_fmi2": DESCRIPTION_2, "events_fmi3": EVENTS}
NAMES = {"kinds_fmi3": "Kinds.fmu", "kinds_fmi2": "Counted.fmu", "events_fmi3": "Ball.fmu"}


def build_kinds(compiler, folder, name):
    """Compile and pack the FMU of the C file of that name; its path."""
    return build_packed(compiler, FOLDER / f"{name}.c", DESCRIPTIONS[name], folder / NAMES[name])
