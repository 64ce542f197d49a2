/* What a co-simulation FMU of FMI 3.0 with Float64 variables alone never has called: the standard wants every
   function in the library. */
#define UNUSED(name) fmi3Status name(void); fmi3Status name(void) { return fmi3Error; }
UNUSED(fmi3SetDebugLogging) UNUSED(fmi3EnterEventMode) UNUSED(fmi3EnterStepMode)
fmi3Instance fmi3InstantiateModelExchange(void);
fmi3Instance fmi3InstantiateModelExchange(void) { return NULL; }
fmi3Instance fmi3InstantiateScheduledExecution(void);
fmi3Instance fmi3InstantiateScheduledExecution(void) { return NULL; }
UNUSED(fmi3GetFloat32) UNUSED(fmi3GetInt8) UNUSED(fmi3GetUInt8) UNUSED(fmi3GetInt16) UNUSED(fmi3GetUInt16)
UNUSED(fmi3GetInt32) UNUSED(fmi3GetUInt32) UNUSED(fmi3GetInt64) UNUSED(fmi3GetUInt64) UNUSED(fmi3GetBoolean)
UNUSED(fmi3GetString) UNUSED(fmi3GetBinary) UNUSED(fmi3GetClock)
UNUSED(fmi3SetFloat32) UNUSED(fmi3SetInt8) UNUSED(fmi3SetUInt8) UNUSED(fmi3SetInt16) UNUSED(fmi3SetUInt16)
UNUSED(fmi3SetInt32) UNUSED(fmi3SetUInt32) UNUSED(fmi3SetInt64) UNUSED(fmi3SetUInt64) UNUSED(fmi3SetBoolean)
UNUSED(fmi3SetString) UNUSED(fmi3SetBinary) UNUSED(fmi3SetClock)
UNUSED(fmi3GetNumberOfVariableDependencies) UNUSED(fmi3GetVariableDependencies)
UNUSED(fmi3GetDirectionalDerivative) UNUSED(fmi3GetAdjointDerivative)
UNUSED(fmi3EnterConfigurationMode) UNUSED(fmi3ExitConfigurationMode)
UNUSED(fmi3GetIntervalDecimal) UNUSED(fmi3GetIntervalFraction) UNUSED(fmi3GetShiftDecimal)
UNUSED(fmi3GetShiftFraction) UNUSED(fmi3SetIntervalDecimal) UNUSED(fmi3SetIntervalFraction)
UNUSED(fmi3SetShiftDecimal) UNUSED(fmi3SetShiftFraction)
UNUSED(fmi3EvaluateDiscreteStates) UNUSED(fmi3UpdateDiscreteStates)
UNUSED(fmi3EnterContinuousTimeMode) UNUSED(fmi3CompletedIntegratorStep) UNUSED(fmi3SetTime)
UNUSED(fmi3SetContinuousStates) UNUSED(fmi3GetContinuousStateDerivatives) UNUSED(fmi3GetEventIndicators)
UNUSED(fmi3GetContinuousStates) UNUSED(fmi3GetNominalsOfContinuousStates)
UNUSED(fmi3GetNumberOfEventIndicators) UNUSED(fmi3GetNumberOfContinuousStates)
UNUSED(fmi3GetOutputDerivatives) UNUSED(fmi3ActivateModelPartition)
